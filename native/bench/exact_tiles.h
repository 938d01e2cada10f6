#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "splat/cpu/tiles/tile_lists.h"

namespace stipple::bench {

/// Smallest q/2 of the footprint over the pixel centres' rectangle [x0,x1] x [y0,y1], in double:
/// q is convex, so it is 0 where the centre lies inside, else the least of the four edges, each a
/// parabola held to its ends. Written apart from the tile lists, which it judges.
inline double leastHalfDistance(const Footprint<double>& f, double x0, double x1, double y0,
                                double y1) {
  if (f.mean_x >= x0 && f.mean_x <= x1 && f.mean_y >= y0 && f.mean_y <= y1) return 0.0;
  double least = 1e300;
  for (const double x : {x0, x1}) {
    const double dx = x - f.mean_x;
    const double dy = std::clamp(-f.l10 / f.l11 * dx, y0 - f.mean_y, y1 - f.mean_y);
    least = std::min(least, halfSquaredDistance(f, dx, dy));
  }
  const double a = f.l00 * f.l00 + f.l10 * f.l10;
  for (const double y : {y0, y1}) {
    const double dy = y - f.mean_y;
    const double dx = std::clamp(-f.l10 * f.l11 / a * dy, x0 - f.mean_x, x1 - f.mean_x);
    least = std::min(least, halfSquaredDistance(f, dx, dy));
  }
  return least;
}

/// Calls visit(tile) for every tile whose rectangle of pixel centres meets the ellipse
/// alpha >= 1/255: every tile of a generous box is tried.
template <typename Visit>
void forEachExactTile(const Footprint<double>& f, double half_x, double half_y,
                      const TileGrid& grid, Visit visit) {
  const double reach = std::log(f.opacity / kMinAlpha);
  const double side = kTileSide;
  const auto cell = [&](double pixel, uint32_t count) {
    return static_cast<int64_t>(std::clamp(std::floor(pixel / side), -1.0, count + 0.0));
  };
  for (int64_t row = cell(f.mean_y - half_y, grid.rows) - 1;
       row <= cell(f.mean_y + half_y, grid.rows) + 1; ++row) {
    for (int64_t column = cell(f.mean_x - half_x, grid.columns) - 1;
         column <= cell(f.mean_x + half_x, grid.columns) + 1; ++column) {
      if (row < 0 || column < 0 || row >= grid.rows || column >= grid.columns) continue;
      const double x0 = static_cast<double>(column) * side + 0.5;
      const double y0 = static_cast<double>(row) * side + 0.5;
      if (leastHalfDistance(f, x0, x0 + side - 1, y0, y0 + side - 1) <= reach) {
        visit(static_cast<size_t>(row) * grid.columns + static_cast<size_t>(column));
      }
    }
  }
}

}  // namespace stipple::bench
