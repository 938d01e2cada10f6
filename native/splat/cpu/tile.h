#pragma once

#include <cstdint>
#include <span>

#include "splat/cpu/tile_kernel.h"
#include "splat/cpu/visible_splats.h"

namespace stipple {

struct Tile {
  uint32_t x0, y0;                   ///< first pixel
  uint32_t width, height;            ///< pixels inside the picture
  std::span<const uint32_t> splats;  ///< slots of visible splats, front to back
};

/// Tile `index` of the grid with its list.
Tile tileOf(const TileGrid& grid, size_t index, std::span<const uint32_t> splats);

/// The splat as a kernel of the tile wants it; finish_doubt holds its own size of g and l, held to
/// kMaxFloatReach.
TileSplat makeTileSplat(const VisibleSplat& splat, const Tile& tile);

/// Splats begin .. begin + count of the tile's list as its kernel wants them. In and out: largest,
/// 0 for the first call of a tile; carried from call to call for finishDoubt.
void makeTileSplats(const VisibleSplat* visible, const Tile& tile, size_t begin, size_t count,
                    float& largest, TileSplat* out);

/// Alpha of a splat of the list at pixel (x, y) of the tile, in double, as the reference has it.
double alphaInDouble(const VisibleSplat& splat, const Tile& tile, uint32_t x, uint32_t y);

/// Nothing blended yet; pixels outside the picture are finished.
void clearPixels(const Tile& tile, TilePixels& pixels);

}  // namespace stipple
