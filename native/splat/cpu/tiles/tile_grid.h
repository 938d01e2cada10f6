#pragma once

#include <cstddef>
#include <cstdint>

namespace stipple {

template <typename T>
struct Projected;

constexpr uint32_t kTileSide = 16;
constexpr uint32_t kTilePixelCount = kTileSide * kTileSide;

struct TileGrid {
  uint32_t width;  ///< pixels
  uint32_t height;
  uint32_t columns;  ///< tiles
  uint32_t rows;

  TileGrid(uint32_t picture_width, uint32_t picture_height)
      : width(picture_width),
        height(picture_height),
        columns((picture_width + kTileSide - 1) / kTileSide),
        rows((picture_height + kTileSide - 1) / kTileSide) {}
  size_t tileCount() const { return static_cast<size_t>(columns) * rows; }
};

/// The tiles that a splat meets, packed so that counting and listing need not look at it again:
///   bits 0..31   one per tile, row-major, 4 rows of 8 tiles
///   bits 32..47  column of the first
///   bits 48..63  row of the first, or kWideSpan: the splat meets more and must be looked at
using TileSpan = uint64_t;
constexpr uint32_t kSpanColumns = 8;
constexpr uint32_t kSpanRows = 4;
constexpr TileSpan kWideSpan = uint64_t{0xffff} << 48;  // grids have at most 4096 columns and rows

TileSpan tileSpanOf(const Projected<double>& splat, const TileGrid& grid);

}  // namespace stipple
