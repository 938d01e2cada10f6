#include "splat/cpu/backward_sums.h"

#include <algorithm>
#include <functional>

#include "base/parallel.h"

namespace stipple {

namespace {

/// Ranges of splats that are added side by side. Each looks up its part of every tile's list, so
/// more of them cost more searches.
constexpr size_t kMostRanges = 64;
constexpr size_t kLeastSplats = 1024;
constexpr size_t kClearedAtOnce = 16384;  // splats

}  // namespace

void BackwardSums::reset(size_t visible_count, BackwardMode mode) {
  visible_count_ = visible_count;
  field_count_ = backwardFieldCount(mode);
  double* sums = sums_.resize(visible_count * field_count_);
  parallelFor(visible_count_, kClearedAtOnce, [&](size_t begin, size_t end) {
    std::fill(sums + begin * field_count_, sums + end * field_count_, 0.0);
  });
}

void BackwardSums::add(const TileListGroup& group, size_t first_tile, size_t end_tile,
                       const float* tile_sums) {
  const size_t grain = std::max(kLeastSplats, (visible_count_ + kMostRanges - 1) / kMostRanges);
  const uint64_t first_entry = group.offsets[first_tile - group.first_tile];
  // By reference where it is handed over: a std::function of a large capture allocates.
  const auto add_range = [&](size_t begin, size_t end) {
    for (size_t tile = first_tile; tile < end_tile; ++tile) {
      // A tile lists its splats in increasing order.
      const std::span<const uint32_t> splats = group.tile(tile);
      const uint64_t tile_entry = group.offsets[tile - group.first_tile] - first_entry;
      auto entry = static_cast<size_t>(
          std::lower_bound(splats.begin(), splats.end(), static_cast<uint32_t>(begin)) -
          splats.begin());
      for (; entry < splats.size() && splats[entry] < end; ++entry) {
        const float* from = tile_sums + (tile_entry + entry) * field_count_;
        double* to = &sums_[splats[entry] * field_count_];
        const size_t summed = std::min<size_t>(field_count_, kFieldLargestError);
        for (size_t field = 0; field < summed; ++field)
          to[field] += static_cast<double>(from[field]);
        for (size_t field = summed; field < field_count_; ++field) {
          to[field] = std::max(to[field], static_cast<double>(from[field]));
        }
      }
    }
  };
  parallelFor(visible_count_, grain, std::ref(add_range));
}

bool BackwardSums::isTouched(size_t visible) const {
  const double* sums = of(visible);
  return std::any_of(sums, sums + field_count_, [](double sum) { return sum != 0.0; });
}

uint64_t BackwardSums::memoryBound(uint64_t visible_count, BackwardMode mode) {
  return visible_count * backwardFieldCount(mode) * sizeof(double);
}

}  // namespace stipple
