#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "splat/render/scene.h"

namespace stipple {

/// Sorts as unsigned numbers: depthKey above, a number below that is the splat's place in memory.
using DepthItem = uint64_t;

inline DepthItem depthItem(double depth, size_t slot) {
  return static_cast<uint64_t>(depthKey(depth)) << 32 | static_cast<uint32_t>(slot);
}

/// What a sort works with; the memory is the caller's.
struct DepthSortArrays {
  DepthItem* items[2];               ///< [ranges * range_size] the first is given, both are written
  std::span<const uint32_t> filled;  ///< items of each range, from its first place on
  size_t range_size;                 ///< places of a range
  size_t count;                      ///< sum of filled
  uint32_t* digits;                  ///< [kDepthSortDigits]
};
constexpr size_t kDepthSortDigits = size_t{16} << 12;

/// The items front to back by their keys, equal keys in the order in which they were given, without
/// gaps: one of arrays.items; the other is free then. Same result for any number of threads.
/// Cost: two or three passes over the items.
DepthItem* sortByDepth(const DepthSortArrays& arrays);

}  // namespace stipple
