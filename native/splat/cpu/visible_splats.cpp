#include "splat/cpu/visible_splats.h"

#include <algorithm>
#include <bit>
#include <functional>

#include "base/parallel.h"

namespace stipple {

namespace {

/// Splats of one task; their inputs (up to 340 bytes each) stay in the second-level cache between
/// the check of their values and the projection.
constexpr size_t kRangeSplats = 2048;
constexpr size_t kGatherSplats = 8192;
/// Chunks of the sort: each has a counter per digit, which are summed on one thread.
constexpr size_t kMaxSortChunks = 16;
constexpr size_t kMinChunkItems = 32768;
constexpr uint32_t kMaxDigitBits = 12;
constexpr size_t kMaxDigits = size_t{1} << kMaxDigitBits;

/// Checks and projects splats [begin, end) into slots from `begin` on. Returns how many are
/// visible.
size_t projectRange(Projector project, const PlacedScene& scene, size_t begin, size_t end,
                    const ProjectedSlots& slots) {
  size_t slot = begin;
  for (size_t cloud = cloudOfSplat(scene, begin); begin < end; ++cloud) {
    const PlacedCloud& placed = scene.clouds[cloud];
    const size_t first = begin - placed.first_index;
    const size_t last = std::min(end - placed.first_index, placed.cloud->size());
    if (!placed.is_checked && !rowsAreValid(*placed.cloud, first, last)) refuseCloud(placed);
    slot = project(scene, placed, first, last, slots, slot);
    begin = placed.first_index + last;
  }
  return slot;
}

/// Stable radix sort of the items by their keys, least significant digit first. Keys are taken from
/// the smallest on, so that a scene that is not deep needs two passes. Chunks are fixed, each
/// counts its digits and then knows where its items go: the order does not depend on threads.
class DepthSort {
 public:
  explicit DepthSort(VisibleSplats& visible)
      : visible_(visible),
        chunks_(std::clamp<size_t>(visible.count / kMinChunkItems, 1, kMaxSortChunks)) {}

  /// The sorted items; the other array of visible.items is free then.
  DepthItem* run() {
    const auto [lowest, highest] = keyRange();
    const uint32_t bits = static_cast<uint32_t>(std::bit_width(highest - lowest));
    if (bits == 0) {
      // All alike: one pass that only closes the gaps between ranges.
      pass(true, lowest, 0, 1);
      return visible_.items[1].get();
    }
    const uint32_t passes = (bits + kMaxDigitBits - 1) / kMaxDigitBits;
    const uint32_t digit_bits = (bits + passes - 1) / passes;
    for (uint32_t i = 0; i < passes; ++i) pass(i == 0, lowest, i * digit_bits, digit_bits);
    return visible_.items[passes % 2].get();
  }

 private:
  struct KeyRange {
    uint32_t lowest, highest;
  };

  KeyRange keyRange() const {
    KeyRange range{UINT32_MAX, 0};
    for (size_t r = 0; r < visible_.filled.size(); ++r) {
      const DepthItem* item = visible_.items[0].get() + r * kRangeSplats;
      for (size_t i = 0; i < visible_.filled[r]; ++i) {
        const uint32_t key = static_cast<uint32_t>(item[i] >> 32);
        range.lowest = std::min(range.lowest, key);
        range.highest = std::max(range.highest, key);
      }
    }
    if (range.lowest > range.highest) return {0, 0};
    return range;
  }

  /// Calls use(first item, count) for the runs of items of one chunk: ranges with gaps between them
  /// before the first pass, a plain part of the array after it.
  template <typename Use>
  void forEachRun(bool first_pass, const DepthItem* from, size_t chunk, Use use) const {
    if (first_pass) {
      const size_t ranges = visible_.filled.size();
      for (size_t r = chunk * ranges / chunks_; r < (chunk + 1) * ranges / chunks_; ++r) {
        use(from + r * kRangeSplats, visible_.filled[r]);
      }
    } else {
      const size_t begin = chunk * visible_.count / chunks_;
      use(from + begin, (chunk + 1) * visible_.count / chunks_ - begin);
    }
  }

  void pass(bool first_pass, uint32_t lowest, uint32_t shift, uint32_t digit_bits) {
    DepthItem* from = visible_.items[flipped_ ? 1 : 0].get();
    DepthItem* to = visible_.items[flipped_ ? 0 : 1].get();
    const size_t digit_count = size_t{1} << digit_bits;
    const auto digitOf = [=](DepthItem item) {
      return (static_cast<uint32_t>(item >> 32) - lowest) >> shift & (digit_count - 1);
    };
    uint32_t* digits = visible_.digits.data();
    const auto count = [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) {
        uint32_t* counts = digits + chunk * digit_count;
        std::fill(counts, counts + digit_count, 0u);
        forEachRun(first_pass, from, chunk, [&](const DepthItem* item, size_t n) {
          for (size_t i = 0; i < n; ++i) ++counts[digitOf(item[i])];
        });
      }
    };
    parallelFor(chunks_, 1, std::cref(count));
    uint32_t sum = 0;
    for (size_t digit = 0; digit < digit_count; ++digit) {
      for (size_t chunk = 0; chunk < chunks_; ++chunk) {
        const uint32_t here = digits[chunk * digit_count + digit];
        digits[chunk * digit_count + digit] = sum;
        sum += here;
      }
    }
    const auto move = [&](size_t begin, size_t end) {
      for (size_t chunk = begin; chunk < end; ++chunk) {
        uint32_t* places = digits + chunk * digit_count;
        forEachRun(first_pass, from, chunk, [&](const DepthItem* item, size_t n) {
          for (size_t i = 0; i < n; ++i) to[places[digitOf(item[i])]++] = item[i];
        });
      }
    };
    parallelFor(chunks_, 1, std::cref(move));
    flipped_ = !flipped_;
  }

  VisibleSplats& visible_;
  size_t chunks_;
  bool flipped_ = false;
};

}  // namespace

void findVisibleSplats(Projector project, const PlacedScene& scene, Progress* progress,
                       VisibleSplats& visible) {
  const size_t count = scene.splat_count;
  visible.count = 0;
  visible.order = nullptr;
  visible.spans = nullptr;
  if (count == 0) return;
  const ProjectedSlots slots = {visible.splats.resize(count), visible.extras.resize(count),
                                visible.items[0].resize(count), visible.slot_spans.resize(count)};
  visible.items[1].resize(count);
  visible.filled.resize(rangeCount(count, kRangeSplats));
  visible.digits.resize(kMaxSortChunks * kMaxDigits);
  const auto project_range = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    const size_t after = projectRange(project, scene, begin, end, slots);
    visible.filled[begin / kRangeSplats] = static_cast<uint32_t>(after - begin);
  };
  parallelFor(count, kRangeSplats, std::cref(project_range));

  for (const uint32_t part : visible.filled) visible.count += part;
  visible.order = DepthSort(visible).run();
  TileSpan* spans = visible.items[visible.order == slots.items ? 1 : 0].get();
  const auto gather = [&](size_t begin, size_t end) {
    if (progress) progress->throwIfCancelled();
    for (size_t i = begin; i < end; ++i) spans[i] = slots.spans[visible.slotAt(i)];
  };
  parallelFor(visible.count, kGatherSplats, std::cref(gather));
  visible.spans = spans;
}

VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress) {
  VisibleSplats visible;
  findVisibleSplats(chosenProjector(), scene, progress, visible);
  return visible;
}

uint64_t visibleSplatsMemoryBound(uint64_t splat_count) {
  const uint64_t arrays = splat_count * (sizeof(VisibleSplat) + sizeof(VisibleExtra) +
                                         2 * sizeof(DepthItem) + sizeof(TileSpan));
  // Arrays on huge pages, 8 MiB at least, are rounded up to 2 MiB.
  return arrays + std::min(arrays / 4, 5 * (uint64_t{2} << 20)) +
         rangeCount(splat_count, kRangeSplats) * sizeof(uint32_t) +
         kMaxSortChunks * kMaxDigits * sizeof(uint32_t);
}

}  // namespace stipple
