#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/cpu/tiles/tile_grid.h"

namespace stipple {

/// A RayForm as one tile sees it, float32: x and y count pixels of the tile.
struct RayTileSplat {
  float g0, g1, l00, l10, l11;        ///< g at the first pixel, and per pixel
  float w0, w1, w00, w01, w11, rest;  ///< w alike; rest = t22^2
  float n, nx, ny;                    ///< place times |w|^2
  float log2_opacity;
  float log2_least;             ///< lower exponents do not show; with room for rounding
  uint32_t row_begin, row_end;  ///< rows of the tile that the splat can touch
};

/// Pixels of a tile that a splat meets.
struct RayMetPixels {
  // With room for the last vector.
  alignas(64) uint32_t pixel[kTilePixelCount + 16];  ///< row * kTileSide + column
  alignas(64) float exponent[kTilePixelCount + 16];  ///< log2 of alpha
  alignas(64) float alpha[kTilePixelCount + 16];     ///< held to nothing
  alignas(64) float place[kTilePixelCount + 16];
};

/// Meets a splat with the pixels of a tile that are open (not 0) and where its place is between
/// near and far. Returns how many pixels it has put into `met`, in order.
using RayTileKernel = size_t (*)(const RayTileSplat& splat, float near_plane, float far_plane,
                                 const float* open, RayMetPixels& met);

struct NamedRayTileKernel {
  const char* target;  ///< as NamedTileKernel::target
  RayTileKernel kernel;
};

/// The plain kernel.
size_t meetTileScalar(const RayTileSplat& splat, float near_plane, float far_plane,
                      const float* open, RayMetPixels& met);

/// As chosenTileKernel() and tileKernels().
RayTileKernel chosenRayTileKernel();
std::vector<NamedRayTileKernel> rayTileKernels();

}  // namespace stipple
