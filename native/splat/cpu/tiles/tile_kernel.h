#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "splat/cpu/tiles/tile_lists.h"

namespace stipple {

/// A splat as one tile sees it, float32. With g(x, y) = (g0 + l00 x, g1 + l10 x + l11 y), x and y
/// the pixel's column and row in the tile, alpha before the clamp is 2^(log2_opacity - |g|^2):
/// the factor sqrt(log2(e)/2) is in g and l.
struct alignas(16) TileSplat {
  float g0, g1;
  float l00, l10, l11;
  /// A pixel is in doubt where the exponent lies within doubt_low below or doubt_high above the
  /// threshold, TileCutOff::log2_least: there rounding could decide. doubt_high is huge for splats
  /// so thin that float32 cannot give their alpha at all.
  float doubt_low, doubt_high;
  /// Relative distance to 1e-4 within which the end of a pixel is in doubt: finishDoubt of the
  /// splats up to this one, or more.
  float finish_doubt;
  float log2_opacity;
  float depth;
  float colour[3];
  uint32_t row_begin, row_end;  ///< rows of the tile that the splat can touch
};

/// What the kernels keep per pixel of a tile, row by row.
struct TilePixels {
  alignas(64) float transmittance[kTilePixelCount];
  alignas(64) float red[kTilePixelCount];
  alignas(64) float green[kTilePixelCount];
  alignas(64) float blue[kTilePixelCount];
  alignas(64) float weighted_depth[kTilePixelCount];
  /// Sum of w: 1 - transmittance, but with all its digits where little covers the pixel.
  alignas(64) float coverage[kTilePixelCount];
  alignas(64) float median_depth[kTilePixelCount];  ///< kNoMedian until it is known
  alignas(64) float count[kTilePixelCount];         ///< below 2^24: exact
  /// kLog2MinAlpha, or kFinished once nothing more may blend.
  alignas(64) float cut[kTilePixelCount];
  /// Not 0: float32 cannot decide this pixel; it is blended again in double.
  alignas(64) float doubt[kTilePixelCount];
  /// Place in the tile's list of the splat that ended the pixel and was not blended.
  alignas(64) int32_t end[kTilePixelCount];
  uint32_t unfinished;  ///< pixels whose cut is not kFinished
  // Only with a surface; otherwise neither written nor read.
  alignas(64) float wall[kTilePixelCount];    ///< its depth; kNoSurface once it has come
  alignas(64) float passes[kTilePixelCount];  ///< its transmittance
  alignas(64) float before[kTilePixelCount];  ///< T before it; kNotYet until it has come
};

constexpr int32_t kNeverEnded = std::numeric_limits<int32_t>::max();

constexpr float kLog2MinAlpha = -7.9943534368588579f;  ///< log2(1/255)
constexpr float kFinished = 1e30f;
constexpr float kNoMedian = -1e38f;
constexpr float kNotYet = -1.0f;
/// How far ln T may be off after `count` splats whose g, l and 15 l sum to at most `largest`, at
/// most kMaxFloatReach, in one tile. Alpha is off by |g| 3.3e-7 largest + 1e-6, relative: g by 4
/// roundings of largest, the exponent by 1e-6, 2^x by 3e-7. That moves ln T by alpha/(1 - alpha)
/// times as much, which is r(alpha) times this splat's share of -ln T, which sums to 9.3; r |g| is
/// at most 2.83 times TileCutOff::reach and r at most 21.5 (at alpha = 0.99). And each factor
/// rounds, 1.2e-7; at most 2,350 splats of 1/255 blend, `most` of the picture's cut-off.
constexpr float finishDoubt(float largest, size_t count, float reach = 1.0f, size_t most = 2350) {
  return 8.8e-6f * reach * largest + 2.5e-4f +
         1.2e-7f * static_cast<float>(count < most ? count : most);
}
/// Above this size of |g|, float32 leaves too few digits: only splats thinner than a quarter of a
/// pixel, which LowPass::kNone alone has.
constexpr float kMaxFloatReach = 200.0f;
/// finishDoubt of the worst tile.
constexpr float kFinishDoubt = finishDoubt(kMaxFloatReach, 2350);
/// Relative distance to 1/2 within which the median depth is in doubt: fewer factors (177) have
/// rounded.
constexpr float kMedianDoubt = 2e-4f;

/// What the picture's cut-off, RenderOptions::least_alpha, is to single precision. Above 1/255 the
/// bounds of 1/255 hold all the more.
struct TileCutOff {
  double least_alpha = 1.0 / 255.0;
  float log2_least = kLog2MinAlpha;
  /// |g| is at most this many times 2.83 where alpha is the least or more: 1 or above.
  float reach = 1.0f;
  size_t most_splats = 2350;  ///< that blend before a pixel ends

  /// In: splats of the tile's list.
  float medianDoubt(size_t count) const;
};

TileCutOff cutOffOf(double least_alpha);

/// Alpha in double, 0 where the splat is skipped. In: context of TileKernelOptions; splat, its
/// place in this call's list; pixel, row * kTileSide + column.
using AlphaJudge = double (*)(const void* context, size_t splat, uint32_t pixel);

/// What a kernel leaves out below the tile; what a splat does not reach is worked on under a mask
/// otherwise, to the same bits. The renderer leaves out all that it can. The others are for
/// benchmarks, which show by them what that saves; kernels have them where colour and depth
/// (forward) or plain gradients (backward) are asked for, and "scalar" has none of them.
enum class TileCulling {
  kNothing,  ///< all 256 pixels of every splat
  kRows,     ///< rows outside the splat's box
  kAll,      ///< and rows and columns of lanes in which nothing shows
};

/// Splats that are wanted next. A kernel asks memory for one with each splat that it works on, so
/// that they arrive meanwhile: they lie far apart, and asked for all at once they are waited for.
struct WantedNext {
  const VisibleSplat* visible = nullptr;
  const uint32_t* slots = nullptr;  ///< [count]
  size_t count = 0;
};

struct TileKernelOptions {
  bool with_depth;
  bool with_extras;  ///< median depth and counts
  /// Asked where rounding could decide whether a splat shows; nullptr: the pixel is in doubt then.
  AlphaJudge judge = nullptr;
  const void* judge_context = nullptr;
  bool with_coverage = false;  ///< beside depth
  bool with_surface = false;   ///< without coverage
  bool surface_shows = false;  ///< false: a matte
  int32_t first = 0;           ///< place of this call's first splat in the tile's list
  TileCulling culling = TileCulling::kAll;
  WantedNext next = {};
  float log2_least = kLog2MinAlpha;   ///< as TileCutOff
  float median_doubt = kMedianDoubt;  ///< TileCutOff::medianDoubt
};

/// Blends the splats in order into the tile; stops early once every pixel is finished.
using TileKernel = void (*)(const TileSplat* splats, size_t count, TileKernelOptions options,
                            TilePixels& pixels);

struct NamedTileKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  TileKernel kernel;
};

/// The kernel to use: the best for this processor, or the one that the environment variable
/// STIPPLE_FORCE_TARGET names when it is first asked for (upper or lower case). Errors:
/// kInvalidArgument where that names no kernel of tileKernels().
TileKernel chosenTileKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<NamedTileKernel> tileKernels();

/// The plain kernel, straight from splat/render/blend.h.
void blendTileScalar(const TileSplat* splats, size_t count, TileKernelOptions options,
                     TilePixels& pixels);

}  // namespace stipple
