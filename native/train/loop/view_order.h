#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// All views once per round, each round in an order of its own. What comes at an iteration depends
/// on (count, seed, iteration) alone, so that a fit can go on from anywhere.
class ViewOrder {
 public:
  /// In: count >= 1.
  ViewOrder(size_t count, uint64_t seed);

  /// 0..count-1. In: iteration from 0. Cost: O(count) where a round begins, else O(1).
  size_t at(uint64_t iteration);

 private:
  std::vector<uint32_t> order_;
  uint64_t seed_;
  uint64_t round_ = UINT64_MAX;
};

}  // namespace stipple
