#include "splat/cpu/backward_sums.h"

#include <algorithm>
#include <functional>

#include "base/parallel.h"
#include "splat/cpu/tile_spans.h"

namespace stipple {

namespace {

/// Whole cache lines.
size_t strideOf(BackwardWants wants) {
  constexpr size_t kLine = 16;
  return (backwardFieldCount(wants) + kLine - 1) / kLine * kLine;
}

}  // namespace

void BackwardSums::reset(size_t splat_count, BackwardWants wants) {
  field_count_ = backwardFieldCount(wants);
  stride_ = strideOf(wants);
  sums_.resize(splat_count * stride_);
  uint8_t* touched = touched_.resize(splat_count);
  std::fill(touched, touched + splat_count, uint8_t{0});
}

namespace {

/// Entries that are asked for before the first of them is added: each lies in another tile's part
/// of memory and would be waited for.
constexpr size_t kEntriesAhead = 64;

struct AskedEntry {
  uint32_t visible;
  const float* values;
};

template <size_t kFieldCount>
void addEntry(const float* from, double* to) {
  for (size_t field = 0; field < std::min<size_t>(kFieldCount, kFieldLargestError); ++field) {
    to[field] += static_cast<double>(from[field]);
  }
  if constexpr (kFieldCount > kFieldLargestError) {
    const double largest = static_cast<double>(from[kFieldLargestError]);
    to[kFieldLargestError] = std::max(to[kFieldLargestError], largest);
    for (size_t field = kFieldLargestError + 1; field < kFieldCount; ++field) {
      to[field] += static_cast<double>(from[field]);
    }
  }
}

}  // namespace

template <size_t kFieldCount>
void BackwardSums::addFields(const VisibleSplats& visible, const TileGrid& grid,
                             const TileListMemory& lists, const TileSums& tiles) {
  const TileListGroup& group = lists.group;
  const size_t group_tiles = group.end_tile - group.first_tile;
  const bool is_first = tiles.first_tile == 0;
  const uint64_t first_entry = group.offsets[tiles.first_tile - group.first_tile];
  cursors_.resize(rangeCount(visible.count, lists.chunk_size) * group_tiles);
  // By reference where it is handed over: a std::function of a large capture allocates.
  const auto add_chunk = [&](size_t begin, size_t end) {
    // Entries of a chunk begin where those of the chunk before it end.
    const size_t chunk = begin / lists.chunk_size;
    uint64_t* cursors = &cursors_[chunk * group_tiles];
    const uint64_t* starts =
        chunk == 0 ? group.offsets.data() : &lists.cursors[(chunk - 1) * group_tiles];
    std::copy_n(starts, group_tiles, cursors);

    AskedEntry asked[kEntriesAhead];
    size_t asked_count = 0;
    size_t current = begin;  // whose sums these are
    double sums[kFieldCount] = {};
    const auto store_sums = [&] {
      if (std::none_of(sums, sums + kFieldCount, [](double sum) { return sum != 0.0; })) return;
      const uint32_t splat = visible.extraAt(current).index;
      float* to = sums_.get() + splat * stride_;
      if (!is_first && touched_[splat] != 0) addEntry<kFieldCount>(to, sums);
      touched_[splat] = 1;
      for (size_t field = 0; field < kFieldCount; ++field) {
        constexpr double kLargest = 3.4e38;
        to[field] = static_cast<float>(std::clamp(sums[field], -kLargest, kLargest));
        sums[field] = 0;
      }
    };
    const auto add_asked = [&] {
      for (size_t i = 0; i < asked_count; ++i) {
        if (asked[i].visible != current) {
          store_sums();
          current = asked[i].visible;
        }
        addEntry<kFieldCount>(asked[i].values, sums);
      }
      asked_count = 0;
    };
    for (size_t i = begin; i < end; ++i) {
      forEachTileOf(visible, i, grid, [&](size_t tile) {
        if (tile < tiles.first_tile || tile >= tiles.end_tile) return;
        const size_t own = tile - group.first_tile;
        const uint64_t entry = cursors[own]++;
        if (entry - group.offsets[own] >= tiles.used[tile]) return;
        const float* values = tiles.values + (entry - first_entry) * kFieldCount;
        __builtin_prefetch(values);
        __builtin_prefetch(values + kFieldCount - 1);
        asked[asked_count++] = {static_cast<uint32_t>(i), values};
        if (asked_count == kEntriesAhead) add_asked();
      });
      __builtin_prefetch(of(visible.extraAt(i).index), 1);
      __builtin_prefetch(&visible.extraAt(std::min(i + kEntriesAhead, end - 1)).index);
    }
    add_asked();
    if (begin < end) store_sums();
  };
  parallelFor(visible.count, lists.chunk_size, std::ref(add_chunk));
}

void BackwardSums::add(const VisibleSplats& visible, const TileGrid& grid,
                       const TileListMemory& lists, const TileSums& tiles) {
  switch (field_count_) {
    case kGradientFieldCount:
      return addFields<kGradientFieldCount>(visible, grid, lists, tiles);
    case kGradientFieldCount + 1:  // depth, or contributions: both are sums
      return addFields<kGradientFieldCount + 1>(visible, grid, lists, tiles);
    case kContributionFieldCount + 1:
      return addFields<kContributionFieldCount + 1>(visible, grid, lists, tiles);
    case kStatisticsFieldCount:
      return addFields<kStatisticsFieldCount>(visible, grid, lists, tiles);
    default:
      return addFields<kStatisticsFieldCount + 1>(visible, grid, lists, tiles);
  }
}

uint64_t BackwardSums::memoryBound(uint64_t splat_count, const TileGrid& grid,
                                   BackwardWants wants) {
  // As many cursors as the lists have themselves; the last term: huge pages round up.
  return splat_count * (strideOf(wants) * sizeof(float) + 1) +
         tileListsBound(splat_count, grid).other_bytes + 2 * (uint64_t{2} << 20);
}

}  // namespace stipple
