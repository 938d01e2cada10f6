#include "splat/cpu/depth_sort.h"

#include <algorithm>
#include <bit>
#include <functional>

#include "base/parallel.h"

namespace stipple {

namespace {

/// Chunks of the sort: each has a counter per digit, which are summed on one thread.
constexpr size_t kMaxSortChunks = 16;
constexpr size_t kMinChunkItems = 32768;
constexpr uint32_t kMaxDigitBits = 12;
static_assert(kDepthSortDigits == kMaxSortChunks << kMaxDigitBits);

/// Stable radix sort of the items by their keys, least significant digit first. Keys are taken from
/// the smallest on, so that a scene that is not deep needs two passes. Chunks are fixed, each
/// counts its digits and then knows where its items go: the order does not depend on threads.
class DepthSort {
 public:
  explicit DepthSort(const DepthSortArrays& arrays)
      : arrays_(arrays),
        chunks_(std::clamp<size_t>(arrays.count / kMinChunkItems, 1, kMaxSortChunks)) {}

  DepthItem* run() {
    const auto [lowest, highest] = keyRange();
    const uint32_t bits = static_cast<uint32_t>(std::bit_width(highest - lowest));
    if (bits == 0) {
      // All alike: one pass that only closes the gaps between ranges.
      pass(true, lowest, 0, 1);
      return arrays_.items[1];
    }
    const uint32_t passes = (bits + kMaxDigitBits - 1) / kMaxDigitBits;
    const uint32_t digit_bits = (bits + passes - 1) / passes;
    for (uint32_t i = 0; i < passes; ++i) pass(i == 0, lowest, i * digit_bits, digit_bits);
    return arrays_.items[passes % 2];
  }

 private:
  struct KeyRange {
    uint32_t lowest, highest;
  };

  KeyRange keyRange() const {
    KeyRange range{UINT32_MAX, 0};
    for (size_t r = 0; r < arrays_.filled.size(); ++r) {
      const DepthItem* item = arrays_.items[0] + r * arrays_.range_size;
      for (size_t i = 0; i < arrays_.filled[r]; ++i) {
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
      const size_t ranges = arrays_.filled.size();
      for (size_t r = chunk * ranges / chunks_; r < (chunk + 1) * ranges / chunks_; ++r) {
        use(from + r * arrays_.range_size, arrays_.filled[r]);
      }
    } else {
      const size_t begin = chunk * arrays_.count / chunks_;
      use(from + begin, (chunk + 1) * arrays_.count / chunks_ - begin);
    }
  }

  void pass(bool first_pass, uint32_t lowest, uint32_t shift, uint32_t digit_bits) {
    DepthItem* from = arrays_.items[flipped_ ? 1 : 0];
    DepthItem* to = arrays_.items[flipped_ ? 0 : 1];
    const size_t digit_count = size_t{1} << digit_bits;
    const auto digitOf = [=](DepthItem item) {
      return (static_cast<uint32_t>(item >> 32) - lowest) >> shift & (digit_count - 1);
    };
    uint32_t* digits = arrays_.digits;
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

  const DepthSortArrays& arrays_;
  size_t chunks_;
  bool flipped_ = false;
};

}  // namespace

DepthItem* sortByDepth(const DepthSortArrays& arrays) {
  return DepthSort(arrays).run();
}

}  // namespace stipple
