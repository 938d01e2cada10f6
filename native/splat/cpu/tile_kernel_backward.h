#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/blend_backward.h"
#include "splat/cpu/tile_kernel.h"

// A tile backwards takes two passes. `mark` goes front to back and finds what the renderer decided:
// which splat is the last at each pixel, the transmittance behind it, and the pixels in doubt.
// `takeOff` then goes back to front over the splats that some pixel shows.

namespace stipple {

/// A splat as one tile sees it.
struct BackwardSplat : TileSplat {
  uint32_t rows;  ///< bit y: some pixel of row y shows the splat; filled by `mark`
};

/// What the kernels keep per pixel of a tile, row by row.
struct BackwardPixels {
  // Of `mark`.
  alignas(64) float transmittance[kTilePixelCount];  ///< behind the last splat so far
  alignas(64) float cut[kTilePixelCount];            ///< as in TilePixels
  alignas(64) float doubt[kTilePixelCount];
  alignas(64) int32_t last[kTilePixelCount];  ///< place in the tile's list, -1: none
  uint32_t unfinished;
  // Of `takeOff`: PixelLoss and PixelBackward.
  alignas(64) float gradient[4][kTilePixelCount];
  alignas(64) float behind[kTilePixelCount];
  alignas(64) float colour_behind[3][kTilePixelCount];
  alignas(64) float signed_weight[3][kTilePixelCount];
  alignas(64) float room[3][kTilePixelCount];
  alignas(64) float edge[kTilePixelCount];
  alignas(64) float error[kTilePixelCount];
};

/// Splats [count] follow each other in the tile's list from place `first` on.
using MarkKernel = void (*)(BackwardSplat* splats, size_t count, int32_t first,
                            BackwardPixels& pixels);
/// The same splats, last first. Out: sums [count][backwardFieldCount(mode)], written whole.
using TakeOffKernel = void (*)(const BackwardSplat* splats, size_t count, int32_t first,
                               BackwardMode mode, BackwardPixels& pixels, float* sums);

struct BackwardKernel {
  const char* target;  ///< as in NamedTileKernel
  MarkKernel mark;
  TakeOffKernel take_off;
};

/// The kernel of the same target as chosenTileKernel().
const BackwardKernel& chosenBackwardKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first.
std::vector<BackwardKernel> backwardKernels();

/// The plain kernels, straight from splat/blend_backward.h.
void markTileScalar(BackwardSplat* splats, size_t count, int32_t first, BackwardPixels& pixels);
void takeOffTileScalar(const BackwardSplat* splats, size_t count, int32_t first, BackwardMode mode,
                       BackwardPixels& pixels, float* sums);

}  // namespace stipple
