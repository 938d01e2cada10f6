#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// Places where splats may begin, and their colours in the compositing space.
struct StartPoints {
  std::vector<float> positions;  ///< [N,3]
  std::vector<float> colours;    ///< [N,3]
  std::vector<double> times;     ///< [N] as of PointSet

  size_t size() const { return positions.size() / 3; }
  /// Others of which it is not known when they were seen.
  void append(const StartPoints& others) {
    positions.insert(positions.end(), others.positions.begin(), others.positions.end());
    colours.insert(colours.end(), others.colours.begin(), others.colours.end());
    if (!times.empty()) times.resize(size(), std::numeric_limits<double>::quiet_NaN());
  }
  void add(const Vec3d& position, const float* colour) {
    for (int k = 0; k < 3; ++k) positions.push_back(static_cast<float>(position[k]));
    colours.insert(colours.end(), colour, colour + 3);
  }
};

}  // namespace stipple
