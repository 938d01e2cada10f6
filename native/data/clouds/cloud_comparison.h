#pragma once

#include <cstdint>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Largest and mean difference of one attribute.
struct Difference {
  double max = 0;
  double mean = 0;
};

/// Differences between two clouds, splat by splat.
struct CloudComparison {
  bool same_order = false;  ///< same count and degree; else the differences stay 0
  Difference position;      ///< metres, per coordinate
  Difference rotation;      ///< radians; q and -q are equal
  Difference scale_ratio;   ///< |ln(scale_a / scale_b)|; +inf where one of them is 0
  Difference opacity;
  Difference sh;
};

/// Splat i of a against splat i of b, in the frame of a: a cloud that a format turned into its own
/// frame equals the one that it came from. An unknown frame is taken for the conventional one.
CloudComparison compare(const SplatCloud& a, const SplatCloud& b);

}  // namespace stipple
