#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "splat/cpu/visible_splats.h"

namespace stipple {

/// Slots of the visible splats of tiles [first_tile, end_tile), each tile front to back.
struct TileListGroup {
  size_t first_tile = 0;
  size_t end_tile = 0;
  std::vector<uint64_t> offsets;  ///< [end_tile - first_tile + 1] into entries
  ReusedArray<uint32_t> entries;

  std::span<const uint32_t> tile(size_t index) const {
    const uint64_t begin = offsets[index - first_tile];
    return {entries.get() + begin, offsets[index - first_tile + 1] - begin};
  }
  /// How many slots lie in memory behind those of a tile.
  size_t listedBehind(size_t index) const {
    return offsets.back() - offsets[index - first_tile + 1];
  }
};

/// What forEachTileGroup works with; kept for the next picture. Afterwards it holds the last group,
/// which is the only one unless the lists are huge.
struct TileListMemory {
  std::vector<uint32_t> counts;  ///< [chunk][tile]
  /// [chunk][tile of the group] Behind the chunk's last entry of the tile.
  std::vector<uint64_t> cursors;
  size_t chunk_size = 0;  ///< splats
  TileListGroup group;
};

/// Lists the splats of every tile and hands them to `use`, a group of tiles at a time, so that the
/// lists stay bounded however many tiles the splats cover. A tile lists exactly the splats whose
/// ellipse alpha >= 1/255 meets the rectangle of its pixel centres (up to boundMargin).
/// Same lists for any number of threads: splats are counted by tile in their order, so no second
/// sort is needed.
void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      const std::function<void(const TileListGroup&)>& use);

/// The same in memory that may hold an earlier picture's lists.
void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      TileListMemory& memory, const std::function<void(const TileListGroup&)>& use);

/// Bytes that forEachTileGroup allocates at most: for the pairs of splat and tile themselves, and
/// for everything else.
struct TileListsBound {
  uint64_t pair_bytes;
  uint64_t other_bytes;
};
TileListsBound tileListsBound(uint64_t splat_count, const TileGrid& grid);

/// Their sum.
uint64_t tileListsMemoryBound(uint64_t splat_count, const TileGrid& grid);

}  // namespace stipple
