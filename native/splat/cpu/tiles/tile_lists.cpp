#include "splat/cpu/tiles/tile_lists.h"

#include <algorithm>

#include "base/parallel.h"
#include "splat/cpu/tiles/tile_spans.h"

namespace stipple {

namespace {

/// Entries (4 bytes) of one group of tiles, unless a single tile needs more.
constexpr uint64_t kGroupEntries = 1u << 25;
/// Counters of all (chunk, tile) pairs together.
constexpr size_t kMaxCounters = size_t{1} << 24;
constexpr size_t kMaxChunks = 32;
constexpr size_t kMinChunkSplats = 2048;

size_t chunkCount(size_t splats, size_t tiles) {
  const size_t wanted = std::clamp<size_t>(splats / kMinChunkSplats, 1, kMaxChunks);
  return std::clamp<size_t>(kMaxCounters / tiles, 1, wanted);
}

}  // namespace

TileSpan tileSpanOf(const Projected<double>& splat, const TileGrid& grid) {
  SpanBox<double> box;
  spanBox(splat.footprint, splat.half_x, splat.half_y, static_cast<double>(grid.columns),
          static_cast<double>(grid.rows), box);
  if (box.last_row - box.first_row >= kSpanRows ||
      box.last_column - box.first_column >= kSpanColumns) {
    return kWideSpan;
  }
  const uint64_t first_row = static_cast<uint64_t>(box.first_row);
  const uint64_t first_column = static_cast<uint64_t>(box.first_column);
  uint64_t mask = 0;
  forEachTileSpan(splat.footprint, splat.half_x, splat.half_y, grid,
                  [&](int64_t row, int64_t first, int64_t last) {
                    const uint64_t columns = (uint64_t{2} << (last - first)) - 1;
                    const uint64_t at = static_cast<uint64_t>(first) - first_column +
                                        (static_cast<uint64_t>(row) - first_row) * kSpanColumns;
                    mask |= columns << at;
                  });
  return mask == 0 ? 0 : first_row << 48 | first_column << 32 | mask;
}

void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      TileListMemory& memory,
                      const std::function<void(const TileListGroup&)>& use) {
  const size_t tiles = grid.tileCount();
  const size_t chunks = chunkCount(visible.count, tiles);
  const size_t chunk_size = std::max<size_t>(1, (visible.count + chunks - 1) / chunks);
  memory.chunk_size = chunk_size;

  std::vector<uint32_t>& counts = memory.counts;
  counts.assign(chunks * tiles, 0);
  const auto count_chunk = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    uint32_t* count = &counts[begin / chunk_size * tiles];
    for (size_t i = begin; i < end; ++i) {
      forEachTileOf(visible, i, grid, [&](size_t tile) { ++count[tile]; });
    }
  };
  parallelFor(visible.count, chunk_size, std::cref(count_chunk));

  TileListGroup& group = memory.group;
  std::vector<uint64_t>& cursors = memory.cursors;
  group.offsets.reserve(tiles + 1);
  for (group.first_tile = 0; group.first_tile < tiles; group.first_tile = group.end_tile) {
    group.offsets.assign(1, 0);
    group.end_tile = group.first_tile;
    while (group.end_tile < tiles) {
      uint64_t total = 0;
      for (size_t chunk = 0; chunk < chunks; ++chunk) {
        total += counts[chunk * tiles + group.end_tile];
      }
      if (group.end_tile > group.first_tile && group.offsets.back() + total > kGroupEntries) break;
      group.offsets.push_back(group.offsets.back() + total);
      ++group.end_tile;
    }
    const size_t group_tiles = group.end_tile - group.first_tile;
    cursors.resize(chunks * group_tiles);
    for (size_t tile = 0; tile < group_tiles; ++tile) {
      uint64_t cursor = group.offsets[tile];
      for (size_t chunk = 0; chunk < chunks; ++chunk) {
        cursors[chunk * group_tiles + tile] = cursor;
        cursor += counts[chunk * tiles + group.first_tile + tile];
      }
    }
    uint32_t* entries = group.entries.resize(group.offsets.back());
    const auto list_chunk = [&](size_t begin, size_t end) {
      if (progress) progress->throwIfCancelled();
      uint64_t* cursor = &cursors[begin / chunk_size * group_tiles];
      for (size_t i = begin; i < end; ++i) {
        const uint32_t slot = visible.slotAt(i);
        forEachTileOf(visible, i, grid, [&](size_t tile) {
          // One comparison: a tile before the group wraps around.
          const size_t own = tile - group.first_tile;
          if (own < group_tiles) entries[cursor[own]++] = slot;
        });
      }
    };
    parallelFor(visible.count, chunk_size, std::cref(list_chunk));
    use(group);
    if (group.end_tile == tiles) break;  // the group stays as it is
  }
}

void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      const std::function<void(const TileListGroup&)>& use) {
  TileListMemory memory;
  forEachTileGroup(visible, grid, progress, memory, use);
}

TileListsBound tileListsBound(uint64_t splat_count, const TileGrid& grid) {
  const uint64_t tiles = grid.tileCount();
  const uint64_t chunks = chunkCount(splat_count, tiles);
  const uint64_t all = splat_count * tiles;  // at most 2^32 * 2^24
  const uint64_t entries = std::min(all, std::max(splat_count, kGroupEntries));
  // Pages of 2 MiB round up.
  return {entries * sizeof(uint32_t) + (uint64_t{2} << 20),
          chunks * tiles * (sizeof(uint64_t) + sizeof(uint32_t)) + (tiles + 1) * sizeof(uint64_t)};
}

uint64_t tileListsMemoryBound(uint64_t splat_count, const TileGrid& grid) {
  const TileListsBound bound = tileListsBound(splat_count, grid);
  return bound.pair_bytes + bound.other_bytes;
}

}  // namespace stipple
