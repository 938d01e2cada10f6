#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace stipple {

/// Groups of numbers that grow as two of them are joined; the root of a group is its smallest.
class JoinedGroups {
 public:
  explicit JoinedGroups(size_t count) : parents_(count) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }
  uint32_t root(uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    const uint32_t first = root(a);
    const uint32_t second = root(b);
    parents_[std::max(first, second)] = std::min(first, second);
  }

 private:
  std::vector<uint32_t> parents_;  ///< none is larger than its own index
};

}  // namespace stipple
