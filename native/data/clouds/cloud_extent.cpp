#include "data/clouds/cloud_extent.h"

#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

constexpr size_t kLeftOut = 200;  ///< one in this many

}  // namespace

CloudExtent cloudExtent(const SplatCloud& cloud) {
  CloudExtent extent;
  const size_t count = cloud.size();
  if (count == 0) return extent;
  double squared = 0;
  std::vector<float> values(count);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < count; ++i) values[i] = cloud.positions[i * 3 + axis];
    const auto low = values.begin() + static_cast<ptrdiff_t>(count / kLeftOut);
    const auto high = values.end() - 1 - static_cast<ptrdiff_t>(count / kLeftOut);
    std::nth_element(values.begin(), low, values.end());
    const double a = static_cast<double>(*low);
    std::nth_element(low, high, values.end());
    const double b = static_cast<double>(*high);
    extent.centre[axis] = 0.5 * (a + b);
    squared += 0.25 * (b - a) * (b - a);
  }
  double radius = std::sqrt(squared);
  if (!(radius > 0)) {
    // All in one place: as large as the largest splat.
    for (const float scale : cloud.scales) radius = std::max(radius, static_cast<double>(scale));
  }
  if (radius > 0) extent.radius = radius;
  return extent;
}

}  // namespace stipple
