#pragma once

#include <algorithm>
#include <vector>

namespace stipple {

/// Bounds of positions [N,3]; left as they are where N is 0.
inline void fillBounds(const std::vector<float>& positions, float lowest[3], float highest[3]) {
  for (size_t i = 0; i < positions.size(); ++i) {
    const size_t axis = i % 3;
    const float value = positions[i];
    lowest[axis] = i < 3 ? value : std::min(lowest[axis], value);
    highest[axis] = i < 3 ? value : std::max(highest[axis], value);
  }
}

}  // namespace stipple
