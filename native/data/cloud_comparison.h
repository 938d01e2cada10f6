#pragma once

#include <cstdint>

#include "data/splat_cloud.h"

namespace stipple {

/// Largest differences between two clouds, splat by splat.
struct CloudComparison {
  bool same_order = false;     ///< same count and degree; else the differences stay 0
  double max_position = 0;     ///< metres
  double max_rotation = 0;     ///< radians; q and -q are equal
  double max_scale_ratio = 0;  ///< |ln(scale_a / scale_b)|; +inf where one of them is 0
  double max_opacity = 0;
  double max_sh = 0;
};

CloudComparison compare(const SplatCloud& a, const SplatCloud& b);

}  // namespace stipple
