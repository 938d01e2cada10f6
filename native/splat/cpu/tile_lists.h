#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "splat/cpu/visible_splats.h"

namespace stipple {

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

/// Indices of the visible splats of tiles [first_tile, end_tile), each tile front to back.
struct TileListGroup {
  size_t first_tile = 0;
  size_t end_tile = 0;
  std::vector<uint64_t> offsets;  ///< [end_tile - first_tile + 1] into entries
  std::vector<uint32_t> entries;

  std::span<const uint32_t> tile(size_t index) const {
    const uint64_t begin = offsets[index - first_tile];
    return {entries.data() + begin, offsets[index - first_tile + 1] - begin};
  }
};

/// Lists the splats of every tile and hands them to `use`, a group of tiles at a time, so that the
/// lists stay bounded however many tiles the splats cover. A tile lists exactly the splats whose
/// ellipse alpha >= 1/255 meets the rectangle of its pixel centres (up to boundMargin).
/// Same lists for any number of threads: splats are counted by tile in their order, so no second
/// sort is needed.
void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      const std::function<void(const TileListGroup&)>& use);

/// Bytes that forEachTileGroup allocates at most.
uint64_t tileListsMemoryBound(uint64_t splat_count, const TileGrid& grid);

}  // namespace stipple
