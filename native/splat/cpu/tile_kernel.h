#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/cpu/tile_lists.h"

namespace stipple {

/// A splat as one tile sees it, float32. With g(x, y) = (g0 + l00 x, g1 + l10 x + l11 y), x and y
/// the pixel's column and row in the tile, alpha before the clamp is 2^(log2_opacity - |g|^2):
/// the factor sqrt(log2(e)/2) is in g and l.
struct TileSplat {
  float g0, g1;
  float l00, l10, l11;
  float log2_opacity;
  /// A pixel is in doubt where the exponent lies within doubt_low below or doubt_high above the
  /// threshold log2(1/255): there rounding could decide. doubt_high is huge for splats so thin that
  /// float32 cannot give their alpha at all.
  float doubt_low, doubt_high;
  float colour[3];
  float depth;
  uint32_t row_begin, row_end;  ///< rows of the tile that the splat can touch
};

/// What the kernels keep per pixel of a tile, row by row.
struct TilePixels {
  alignas(64) float transmittance[kTilePixelCount];
  alignas(64) float red[kTilePixelCount];
  alignas(64) float green[kTilePixelCount];
  alignas(64) float blue[kTilePixelCount];
  alignas(64) float weighted_depth[kTilePixelCount];
  alignas(64) float median_depth[kTilePixelCount];  ///< kNoMedian until it is known
  alignas(64) float count[kTilePixelCount];         ///< at most 2,350 splats blend: exact
  /// Smallest exponent that still blends: kLog2MinAlpha, or kFinished once nothing more may.
  alignas(64) float cut[kTilePixelCount];
  /// Not 0: float32 cannot decide this pixel; it is blended again in double.
  alignas(64) float doubt[kTilePixelCount];
  uint32_t unfinished;  ///< pixels whose cut is not kFinished
};

constexpr float kLog2MinAlpha = -7.9943534368588579f;  ///< log2(1/255)
constexpr float kFinished = 1e30f;
constexpr float kNoMedian = -1e38f;
/// Relative distance to 1e-4 within which the end of a pixel is in doubt. The transmittance is off
/// by less: at most 9.2/ln(255/254) = 2,350 factors round by 1.2e-7 each, and the errors of alpha,
/// grown by alpha/(1 - alpha), add about 5e-4 (alpha near 0.99 has a small |g|, so a small error).
constexpr float kFinishDoubt = 2e-3f;
/// The same about T = 1/2 for the median depth, where fewer factors (177) have rounded.
constexpr float kMedianDoubt = 2e-4f;

struct TileKernelOptions {
  bool with_depth;
  bool with_extras;  ///< median depth and counts
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

/// The plain kernel, straight from splat/blend.h.
void blendTileScalar(const TileSplat* splats, size_t count, TileKernelOptions options,
                     TilePixels& pixels);

}  // namespace stipple
