#include "splat/cpu/tile_lists.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

// Based on: the exact ellipse-tile test of Hanson et al., Speedy-Splat, CVPR 2025, and the
// opacity-aware extent of Radl et al., StopThePop, SIGGRAPH 2024. Differs: one closed form per tile
// row. The part of the ellipse inside the row is convex, so the tiles it meets are exactly those
// that its x interval meets.

namespace stipple {

namespace {

/// Entries (4 bytes) of one group of tiles, unless a single tile needs more.
constexpr uint64_t kGroupEntries = 1u << 25;
/// Counters of all (chunk, tile) pairs together.
constexpr size_t kMaxCounters = size_t{1} << 24;
constexpr size_t kMaxChunks = 64;
constexpr size_t kMinChunkSplats = 4096;

/// Tiles whose pixel centres meet [low, high] pixels, as first..last; empty: first > last.
struct TileRange {
  int64_t first;
  int64_t last;
};

TileRange tilesBetween(double low, double high, uint32_t tile_count) {
  constexpr double kSide = kTileSide;
  const double count = tile_count;
  // Held in range as doubles: the ends may be far outside that of an integer.
  const double first = std::clamp(std::ceil((low - (kSide - 0.5)) / kSide), 0.0, count);
  const double last = std::clamp(std::floor((high - 0.5) / kSide), -1.0, count - 1.0);
  return {static_cast<int64_t>(first), static_cast<int64_t>(last)};
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

size_t chunkCount(size_t splats, size_t tiles) {
  const size_t wanted = std::clamp<size_t>(splats / kMinChunkSplats, 1, kMaxChunks);
  return std::clamp<size_t>(kMaxCounters / tiles, 1, wanted);
}

}  // namespace

void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      const std::function<void(const TileListGroup&)>& use) {
  const size_t tiles = grid.tileCount();
  const size_t chunks = chunkCount(visible.count, tiles);
  const size_t chunk_size = std::max<size_t>(1, (visible.count + chunks - 1) / chunks);

  std::vector<uint32_t> counts(chunks * tiles, 0);  // [chunk][tile]
  parallelFor(visible.count, chunk_size, [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    uint32_t* count = &counts[begin / chunk_size * tiles];
    for (size_t i = begin; i < end; ++i) {
      forEachTileSpan(visible.splats[i], grid, [&](int64_t row, int64_t first, int64_t last) {
        uint32_t* tile = count + static_cast<size_t>(row) * grid.columns;
        for (int64_t column = first; column <= last; ++column) ++tile[column];
      });
    }
  });

  TileListGroup group;
  std::vector<uint64_t> cursors;  // [chunk][tile of the group]
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
    group.entries.resize(group.offsets.back());
    parallelFor(visible.count, chunk_size, [&](size_t begin, size_t end) {
      if (progress) progress->throwIfCancelled();
      uint64_t* cursor = &cursors[begin / chunk_size * group_tiles];
      for (size_t i = begin; i < end; ++i) {
        const uint32_t splat = static_cast<uint32_t>(i);
        forEachTileSpan(visible.splats[i], grid, [&](int64_t row, int64_t first, int64_t last) {
          const size_t row_start = static_cast<size_t>(row) * grid.columns;
          const size_t from = std::max(row_start + static_cast<size_t>(first), group.first_tile);
          const size_t to = std::min(row_start + static_cast<size_t>(last) + 1, group.end_tile);
          for (size_t tile = from; tile < to; ++tile) {
            group.entries[cursor[tile - group.first_tile]++] = splat;
          }
        });
      }
    });
    use(group);
  }
}

uint64_t tileListsMemoryBound(uint64_t splat_count, const TileGrid& grid) {
  const uint64_t tiles = grid.tileCount();
  const uint64_t chunks = chunkCount(splat_count, tiles);
  const uint64_t all = splat_count * tiles;  // at most 2^32 * 2^24
  const uint64_t entries = std::min(all, std::max(splat_count, kGroupEntries));
  // Twice: a vector that grows holds the old and the new array for a moment.
  return 2 * (entries * sizeof(uint32_t) + chunks * tiles * sizeof(uint64_t) +
              (tiles + 1) * sizeof(uint64_t)) +
         chunks * tiles * sizeof(uint32_t);
}

}  // namespace stipple
