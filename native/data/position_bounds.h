#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stipple {

/// Bounds of positions [N,3]. Out: lowest, highest [3], which stay as they are where N is 0.
inline void fillBounds(const std::vector<float>& positions, float* lowest, float* highest) {
  for (size_t i = 0; i < positions.size(); ++i) {
    const size_t axis = i % 3;
    const float value = positions[i];
    lowest[axis] = i < 3 ? value : std::min(lowest[axis], value);
    highest[axis] = i < 3 ? value : std::max(highest[axis], value);
  }
}

}  // namespace stipple
