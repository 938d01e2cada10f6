#pragma once

#include <array>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Where a cloud lies, without its far outliers.
struct CloudExtent {
  std::array<double, 3> centre = {0, 0, 0};  ///< metres
  double radius = 1;                         ///< metres; > 0
};

/// The box that leaves out 1 in 200 centres at each end of each axis: its middle and half its
/// diagonal. Cost: O(N).
CloudExtent cloudExtent(const SplatCloud& cloud);

}  // namespace stipple
