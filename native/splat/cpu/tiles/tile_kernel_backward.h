#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/render/blend_backward.h"

namespace stipple {

/// What the kernels keep per pixel of a tile, row by row.
struct BackwardPixels {
  /// Splats from this place of the tile's list on are not in the pixel, nor are any where it is 0
  /// or less.
  alignas(64) int32_t end[kTilePixelCount];
  int32_t row_end[kTileSide];  ///< the largest of each row
  // PixelLoss and PixelBackward.
  alignas(64) float transmittance[kTilePixelCount];
  alignas(64) float gradient[4][kTilePixelCount];
  alignas(64) float depth[kTilePixelCount];
  alignas(64) float depth_gradient[kTilePixelCount];
  alignas(64) float behind[kTilePixelCount];
  alignas(64) float signed_behind[3][kTilePixelCount];
  alignas(64) float signed_weight[3][kTilePixelCount];
  alignas(64) float room[3][kTilePixelCount];
  alignas(64) float edge[kTilePixelCount];
  alignas(64) float error[kTilePixelCount];
};

/// Takes a splat off one pixel in double where float32 cannot decide whether it shows. In: context
/// of TakeOffOptions; splat, its place in this call's list. Adds to sums.
using TakeOffJudge = void (*)(const void* context, size_t splat, uint32_t pixel,
                              BackwardPixels& pixels, float* sums);

struct TakeOffOptions {
  BackwardWants wants;
  int32_t first;  ///< place of this call's first splat in the tile's list
  TakeOffJudge judge;
  const void* judge_context;
  TileCulling culling = TileCulling::kAll;
  WantedNext next = {};
};

/// Takes splats [count], which follow each other in the tile's list, off its pixels, last first.
/// Out: sums [count][backwardFieldCount(wants)], written whole.
using TakeOffKernel = void (*)(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                               BackwardPixels& pixels, float* sums);

struct BackwardKernel {
  const char* target;  ///< as in NamedTileKernel
  TileKernel blend;    ///< of the same target: both must see the same alpha
  TakeOffKernel take_off;
};

/// The kernel of the same target as chosenTileKernel().
const BackwardKernel& chosenBackwardKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first.
std::vector<BackwardKernel> backwardKernels();

/// The plain kernel, straight from splat/render/blend_backward.h.
void takeOffTileScalar(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                       BackwardPixels& pixels, float* sums);

}  // namespace stipple
