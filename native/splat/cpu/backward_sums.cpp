#include "splat/cpu/backward_sums.h"

#include <algorithm>
#include <bit>
#include <functional>

#include "base/parallel.h"
#include "splat/cpu/tiles/tile_spans.h"

namespace stipple {

namespace {

/// Whole cache lines; a single sum is no more than what it is.
size_t strideOf(BackwardWants wants) {
  constexpr size_t kLine = 16;
  if (backwardFieldCount(wants) == 1) return 1;
  return (backwardFieldCount(wants) + kLine - 1) / kLine * kLine;
}

}  // namespace

void BackwardSums::reset(size_t slot_count, BackwardWants wants) {
  field_count_ = backwardFieldCount(wants);
  stride_ = strideOf(wants);
  sums_.resize(slot_count * stride_);
  uint8_t* touched = touched_.resize(slot_count);
  std::fill(touched, touched + slot_count, uint8_t{0});
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

/// Size of the largest of some numbers, as its bits, which are in the same order.
template <size_t kFieldCount>
uint64_t largestBits(const double* sums) {
  uint64_t largest = 0;
  for (size_t field = 0; field < kFieldCount; ++field) {
    largest = std::max(largest, std::bit_cast<uint64_t>(sums[field]) & ~(uint64_t{1} << 63));
  }
  return largest;
}

}  // namespace

template <size_t kFieldCount>
void BackwardSums::storeSums(size_t slot, bool is_first, double* sums) {
  constexpr double kLargest = 3.4e38;
  uint64_t largest = largestBits<kFieldCount>(sums);
  if (largest == 0) return;
  float* to = sums_.get() + slot * stride_;
  if (!is_first && touched_[slot] != 0) {
    addEntry<kFieldCount>(to, sums);
    largest = largestBits<kFieldCount>(sums);
  }
  touched_[slot] = 1;
  if (largest > std::bit_cast<uint64_t>(kLargest)) {
    for (size_t field = 0; field < kFieldCount; ++field) {
      sums[field] = std::clamp(sums[field], -kLargest, kLargest);
    }
  }
  for (size_t field = 0; field < kFieldCount; ++field) to[field] = static_cast<float>(sums[field]);
}

template <size_t kFieldCount>
void BackwardSums::addFields(const VisibleSplats& visible, const TileGrid& grid,
                             const TileListMemory& lists, const TileSums& tiles) {
  const TileListGroup& group = lists.group;
  const size_t group_tiles = group.end_tile - group.first_tile;
  const size_t tile_count = tiles.end_tile - tiles.first_tile;
  const bool is_first = tiles.first_tile == 0;
  const size_t skipped = tiles.first_tile - group.first_tile;
  const uint64_t first_entry = group.offsets[skipped];
  cursors_.resize(rangeCount(visible.count, lists.chunk_size) * tile_count);
  ends_.resize(tile_count);
  for (size_t tile = 0; tile < tile_count; ++tile) {
    ends_[tile] = group.offsets[skipped + tile] + tiles.used[tiles.first_tile + tile];
  }
  // By reference where it is handed over: a std::function of a large capture allocates.
  const auto add_chunk = [&](size_t begin, size_t end) {
    // Entries of a chunk begin where those of the chunk before it end.
    const size_t chunk = begin / lists.chunk_size;
    uint64_t* cursors = &cursors_[chunk * tile_count];
    const uint64_t* starts =
        chunk == 0 ? group.offsets.data() : &lists.cursors[(chunk - 1) * group_tiles];
    std::copy_n(starts + skipped, tile_count, cursors);
    const uint64_t* ends = ends_.data();

    AskedEntry asked[kEntriesAhead];
    size_t asked_count = 0;
    size_t current = begin;  // whose sums these are
    double sums[kFieldCount] = {};
    const auto store_sums = [&] {
      storeSums<kFieldCount>(visible.slotAt(current), is_first, sums);
      std::fill(sums, sums + kFieldCount, 0.0);
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
        // One comparison: a tile before the first wraps around.
        const size_t own = tile - tiles.first_tile;
        if (own >= tile_count) return;
        const uint64_t entry = cursors[own]++;
        if (entry >= ends[own]) return;
        const float* here = tiles.values + (entry - first_entry) * kFieldCount;
        __builtin_prefetch(here);
        __builtin_prefetch(here + kFieldCount - 1);
        asked[asked_count++] = {static_cast<uint32_t>(i), here};
        if (asked_count == kEntriesAhead) add_asked();
      });
      __builtin_prefetch(of(visible.slotAt(i)), 1);
    }
    add_asked();
    if (begin < end) store_sums();
  };
  parallelFor(visible.count, lists.chunk_size, std::ref(add_chunk));
}

void BackwardSums::add(const VisibleSplats& visible, const TileGrid& grid,
                       const TileListMemory& lists, const TileSums& tiles) {
  switch (field_count_) {
    case kWeightFieldCount:
      return addFields<kWeightFieldCount>(visible, grid, lists, tiles);
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
         tileListsBound(splat_count, grid).other_bytes + grid.tileCount() * sizeof(uint64_t) +
         2 * (uint64_t{2} << 20);
}

}  // namespace stipple
