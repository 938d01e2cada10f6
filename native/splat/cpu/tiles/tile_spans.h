#pragma once

#include <algorithm>
#include <bit>
#include <cmath>

#include "splat/cpu/tiles/tile_grid.h"
#include "splat/cpu/visible_splats.h"

namespace stipple {

inline double wholePart(double value) {
  return static_cast<double>(static_cast<int64_t>(value));
}

#include "splat/cpu/tiles/tile_span_steps-inl.h"

/// Calls visit(tile_row, first_column, last_column) for every tile row that the splat meets.
template <typename Visit>
void forEachTileSpan(const Footprint<double>& f, double half_x, double half_y, const TileGrid& grid,
                     Visit visit) {
  const double columns = grid.columns;
  SpanBox<double> box;
  spanBox(f, half_x, half_y, columns, static_cast<double>(grid.rows), box);
  // One row or column of tiles: the box is exact.
  const bool is_box = box.first_row == box.last_row || box.first_column >= box.last_column;
  for (double row = box.first_row; row <= box.last_row; row += 1.0) {
    double first = box.first_column, last = box.last_column;
    if (!is_box) rowColumns(box, row, columns, first, last);
    if (first <= last) {
      visit(static_cast<int64_t>(row), static_cast<int64_t>(first), static_cast<int64_t>(last));
    }
  }
}

/// Calls visit(tile_row, first_column, last_column) as forEachTileSpan, by the packed span.
template <typename Visit>
void forEachTileOf(const VisibleSplats& visible, size_t i, const TileGrid& grid, Visit visit) {
  const TileSpan span = visible.spans[i];
  if (span >= kWideSpan) {
    const uint32_t slot = visible.slotAt(i);
    forEachTileSpan(visible.slots().footprint(slot), visible.extras[slot].half_x,
                    static_cast<double>(visible.splats[slot].half_y), grid,
                    [&](int64_t row, int64_t first, int64_t last) {
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
