#include "splat/cpu/backward_sums.h"

#include <algorithm>
#include <functional>

#include "base/parallel.h"
#include "splat/cpu/tile_spans.h"

namespace stipple {

void BackwardSums::reset(size_t splat_count, BackwardWants wants) {
  field_count_ = backwardFieldCount(wants);
  sums_.resize(splat_count * field_count_);
  uint8_t* touched = touched_.resize(splat_count);
  std::fill(touched, touched + splat_count, uint8_t{0});
}

template <size_t kFieldCount>
void BackwardSums::addFields(const VisibleSplats& visible, const TileGrid& grid,
                             const TileListMemory& lists, const TileSums& tiles) {
  constexpr size_t kSummed = std::min<size_t>(kFieldCount, kFieldLargestError);
  const TileListGroup& group = lists.group;
  const size_t group_tiles = group.end_tile - group.first_tile;
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
    for (size_t i = begin; i < end; ++i) {
      double sums[kFieldCount] = {};
      bool is_touched = false;
      forEachTileOf(visible, i, grid, [&](size_t tile) {
        if (tile < tiles.first_tile || tile >= tiles.end_tile) return;
        const size_t own = tile - group.first_tile;
        const uint64_t entry = cursors[own]++;
        if (entry - group.offsets[own] >= tiles.used[tile]) return;
        const float* from = tiles.values + (entry - first_entry) * kFieldCount;
        for (size_t field = 0; field < kSummed; ++field) {
          sums[field] += static_cast<double>(from[field]);
        }
        for (size_t field = kSummed; field < kFieldCount; ++field) {
          const double value = static_cast<double>(from[field]);
          sums[field] =
              field == kFieldLargestError ? std::max(sums[field], value) : sums[field] + value;
        }
        is_touched = true;
      });
      if (!is_touched) continue;
      is_touched = std::any_of(sums, sums + kFieldCount, [](double sum) { return sum != 0.0; });
      if (!is_touched) continue;
      const uint32_t splat = visible.splats[i].index;
      double* to = of(splat);
      if (touched_[splat] == 0) {
        std::copy_n(sums, kFieldCount, to);
        touched_[splat] = 1;
        continue;
      }
      for (size_t field = 0; field < kFieldCount; ++field) {
        to[field] = kFieldCount > kFieldLargestError && field == kFieldLargestError
                        ? std::max(to[field], sums[field])
                        : to[field] + sums[field];
      }
    }
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
  return splat_count * (backwardFieldCount(wants) * sizeof(double) + 1) +
         tileListsBound(splat_count, grid).other_bytes + 2 * (uint64_t{2} << 20);
}

}  // namespace stipple
