#pragma once

#include <cstdint>
#include <span>

#include "splat/cpu/tile_kernel.h"
#include "splat/cpu/visible_splats.h"

namespace stipple {

struct Tile {
  uint32_t x0, y0;                   ///< first pixel
  uint32_t width, height;            ///< pixels inside the picture
  std::span<const uint32_t> splats;  ///< indices of visible splats, front to back
};

/// Tile `index` of the grid with its list.
Tile tileOf(const TileGrid& grid, size_t index, std::span<const uint32_t> splats);

/// The splat as the tile's kernel wants it.
TileSplat makeTileSplat(const VisibleSplat& splat, const Tile& tile);

/// Nothing blended yet; pixels outside the picture are finished.
void clearPixels(const Tile& tile, TilePixels& pixels);

}  // namespace stipple
