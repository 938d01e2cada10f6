#pragma once

#include <algorithm>
#include <bit>
#include <cmath>

#include "splat/cpu/tile_grid.h"
#include "splat/cpu/visible_splats.h"

// Based on: the exact ellipse-tile test of Hanson et al., Speedy-Splat, CVPR 2025, and the
// opacity-aware extent of Radl et al., StopThePop, SIGGRAPH 2024. Differs: one closed form per tile
// row. The part of the ellipse inside the row is convex, so the tiles it meets are exactly those
// that its x interval meets.

namespace stipple {

/// Tiles whose pixel centres meet [low, high] pixels, as first..last; empty: first > last.
struct TileRange {
  int64_t first;
  int64_t last;
};

inline TileRange tilesBetween(double low, double high, uint32_t tile_count) {
  constexpr double kSide = kTileSide;
  const double count = tile_count;
  // Held in range as doubles: the ends may be far outside that of an integer. Then whole parts by
  // conversion, which is one instruction everywhere, unlike std::floor.
  const double first = std::clamp((low - (kSide - 0.5)) / kSide, 0.0, count);
  const double after = std::clamp((high - 0.5) / kSide + 1.0, 0.0, count);
  const int64_t below = static_cast<int64_t>(first);
  return {below + (static_cast<double>(below) < first ? 1 : 0), static_cast<int64_t>(after) - 1};
}

/// Calls visit(tile_row, first_column, last_column) for every tile row that the splat meets.
template <typename Visit>
void forEachTileSpan(const VisibleSplat& splat, const TileGrid& grid, Visit visit) {
  const Footprint<double>& f = splat.footprint;
  const double half_x = splat.half_x;
  const double half_y = splat.half_y;
  const TileRange rows = tilesBetween(f.mean_y - half_y, f.mean_y + half_y, grid.rows);
  const TileRange columns = tilesBetween(f.mean_x - half_x, f.mean_x + half_x, grid.columns);
  if (columns.first > columns.last) return;
  if (rows.first == rows.last || columns.first == columns.last) {
    // One row or column of tiles: the box is exact.
    for (int64_t row = rows.first; row <= rows.last; ++row) visit(row, columns.first, columns.last);
    return;
  }
  // The ellipse is |L d|^2 <= reach^2. For a given dy its x interval is
  // (-l10 l11 dy -+ sqrt(reach^2 a - (l00 l11 dy)^2)) / a with a = l00^2 + l10^2; its rightmost
  // point lies at dy = -l10/l11 half_x and its leftmost opposite.
  const double reach = half_x * f.l00;
  const double a = f.l00 * f.l00 + f.l10 * f.l10;
  const double rightmost_dy = -f.l10 / f.l11 * half_x;
  const auto edge = [&](double dy, double sign) {
    const double across = f.l00 * f.l11 * dy;
    const double root = std::sqrt(std::max(0.0, reach * reach * a - across * across));
    return (-f.l10 * f.l11 * dy + sign * root) / a;
  };
  for (int64_t row = rows.first; row <= rows.last; ++row) {
    const double top = static_cast<double>(row) * kTileSide + 0.5 - f.mean_y;
    const double bottom = top + (kTileSide - 1);
    const double right = edge(std::clamp(rightmost_dy, top, bottom), 1.0);
    const double left = edge(std::clamp(-rightmost_dy, top, bottom), -1.0);
    const TileRange span = tilesBetween(f.mean_x + left - boundMargin(left),
                                        f.mean_x + right + boundMargin(right), grid.columns);
    const int64_t first = std::max(span.first, columns.first);
    const int64_t last = std::min(span.last, columns.last);
    if (first <= last) visit(row, first, last);
  }
}

/// Calls visit(tile_row, first_column, last_column) as forEachTileSpan, by the packed span.
template <typename Visit>
void forEachTileOf(const VisibleSplats& visible, size_t i, const TileGrid& grid, Visit visit) {
  const TileSpan span = visible.spans[i];
  if (span >= kWideSpan) {
    forEachTileSpan(visible.at(i), grid, [&](int64_t row, int64_t first, int64_t last) {
      const size_t start = static_cast<size_t>(row) * grid.columns;
      for (int64_t column = first; column <= last; ++column) {
        visit(start + static_cast<size_t>(column));
      }
    });
    return;
  }
  const size_t first = (span >> 48) * grid.columns + (span >> 32 & 0xffff);
  for (uint32_t left = static_cast<uint32_t>(span); left != 0; left &= left - 1) {
    const uint32_t bit = static_cast<uint32_t>(std::countr_zero(left));
    visit(first + size_t{bit / kSpanColumns} * grid.columns + bit % kSpanColumns);
  }
}

}  // namespace stipple
