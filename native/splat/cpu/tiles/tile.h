#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/cpu/visible_splats.h"

namespace stipple {

struct Tile {
  uint32_t x0, y0;                   ///< first pixel
  uint32_t width, height;            ///< pixels inside the picture
  std::span<const uint32_t> splats;  ///< slots of visible splats, front to back
  size_t listed_behind = 0;  ///< slots that lie in memory right behind them: the next tile's
  TileCutOff cut_off = {};
};

/// Calls use(pixel of the tile, pixel of the picture) for those of the tile inside the picture.
template <typename Use>
void forEachPixel(const Tile& tile, uint32_t width, Use use) {
  for (uint32_t y = 0; y < tile.height; ++y) {
    const size_t row = static_cast<size_t>(tile.y0 + y) * width + tile.x0;
    for (uint32_t x = 0; x < tile.width; ++x) {
      use(static_cast<size_t>(y) * kTileSide + x, row + x);
    }
  }
}

/// Tile `index` of the grid with its list.
Tile tileOf(const TileGrid& grid, size_t index, std::span<const uint32_t> splats);

/// The splat as a kernel of the tile wants it; finish_doubt holds its own size of g and l, held to
/// kMaxFloatReach.
TileSplat makeTileSplat(const VisibleSplat& splat, const Tile& tile);

/// Splats begin .. begin + count of the tile's list as its kernel wants them. In and out: largest,
/// 0 for the first call of a tile; carried from call to call for finishDoubt.
void makeTileSplats(const VisibleSplat* visible, const Tile& tile, size_t begin, size_t count,
                    float& largest, TileSplat* out);

/// False where a splat of the list surely does not show at pixel (x, y) of the tile. Out: distance,
/// as halfSquaredDistance, where true.
inline bool mayShow(const VisibleSplat& splat, const Tile& tile, uint32_t x, uint32_t y,
                    double& distance) {
  const double dx = tile.x0 + x + 0.5 - splat.mean_x;
  const double dy = tile.y0 + y + 0.5 - splat.mean_y;
  if (std::abs(dy) > static_cast<double>(splat.half_y)) return false;
  const Footprint<double> shape = {splat.mean_x, splat.mean_y, splat.l00,
                                   splat.l10,    splat.l11,    1.0};
  distance = halfSquaredDistance(shape, dx, dy);
  constexpr double kLog2e = 1.4426950408889634, kRounding = 1e-4;
  const double log2_reach = static_cast<double>(splat.log2_opacity - tile.cut_off.log2_least);
  return distance * kLog2e <= log2_reach + kRounding;
}

/// Alpha of a splat of the list at pixel (x, y) of the tile, in double, as the reference has it.
double alphaInDouble(const SplatSlots& slots, uint32_t slot, const Tile& tile, uint32_t x,
                     uint32_t y);

/// Nothing blended yet; pixels outside the picture are finished.
void clearPixels(const Tile& tile, TilePixels& pixels);

}  // namespace stipple
