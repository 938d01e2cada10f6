#include "splat/cpu/tile_lists.h"

#include <algorithm>
#include <bit>
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
constexpr size_t kMaxChunks = 32;
constexpr size_t kMinChunkSplats = 2048;

/// Tiles whose pixel centres meet [low, high] pixels, as first..last; empty: first > last.
struct TileRange {
  int64_t first;
  int64_t last;
};

TileRange tilesBetween(double low, double high, uint32_t tile_count) {
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
    forEachTileSpan(visible.splats[i], grid, [&](int64_t row, int64_t first, int64_t last) {
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

size_t chunkCount(size_t splats, size_t tiles) {
  const size_t wanted = std::clamp<size_t>(splats / kMinChunkSplats, 1, kMaxChunks);
  return std::clamp<size_t>(kMaxCounters / tiles, 1, wanted);
}

}  // namespace

TileSpan tileSpanOf(const VisibleSplat& splat, const TileGrid& grid) {
  int64_t first_row = -1, first_column = 0;
  bool fits = true;
  uint32_t mask = 0;
  // The first row need not begin leftmost: columns count from the box.
  const double left = splat.footprint.mean_x - splat.half_x;
  first_column = tilesBetween(left, left, grid.columns).last;
  first_column = std::max<int64_t>(first_column, 0);
  forEachTileSpan(splat, grid, [&](int64_t row, int64_t first, int64_t last) {
    if (first_row < 0) first_row = row;
    if (row - first_row >= kSpanRows || first < first_column ||
        last - first_column >= kSpanColumns) {
      fits = false;
      return;
    }
    const uint32_t columns = ((2u << (last - first)) - 1u) << (first - first_column);
    mask |= columns << static_cast<uint32_t>(row - first_row) * kSpanColumns;
  });
  if (!fits) return kWideSpan;
  if (mask == 0) return 0;
  return static_cast<uint64_t>(first_row) << 48 | static_cast<uint64_t>(first_column) << 32 | mask;
}

void forEachTileGroup(const VisibleSplats& visible, const TileGrid& grid, Progress* progress,
                      TileListMemory& memory,
                      const std::function<void(const TileListGroup&)>& use) {
  const size_t tiles = grid.tileCount();
  const size_t chunks = chunkCount(visible.count, tiles);
  const size_t chunk_size = std::max<size_t>(1, (visible.count + chunks - 1) / chunks);

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
        const uint32_t splat = static_cast<uint32_t>(i);
        forEachTileOf(visible, i, grid, [&](size_t tile) {
          // One comparison: a tile before the group wraps around.
          const size_t own = tile - group.first_tile;
          if (own < group_tiles) entries[cursor[own]++] = splat;
        });
      }
    };
    parallelFor(visible.count, chunk_size, std::cref(list_chunk));
    use(group);
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
