#include "fit/object_placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace stipple {

namespace {

// Of the splats that count, how many lie beyond each end of an axis: single ones fly off.
constexpr double kOutliers = 0.005;
// Splats that show less than this do not make an object larger.
constexpr float kLeastOpacity = 0.1f;

struct Extent {
  double low = 0, high = 0;
};

Extent extentOf(const SplatCloud& cloud, size_t axis, float least_opacity) {
  std::vector<float> values;
  for (size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.opacities[i] >= least_opacity) values.push_back(cloud.positions[3 * i + axis]);
  }
  if (values.empty()) return {};
  const auto cut = static_cast<size_t>(kOutliers * static_cast<double>(values.size()));
  const auto at = [&](size_t rank) {
    std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(rank), values.end());
    return static_cast<double>(values[rank]);
  };
  return {at(cut), at(values.size() - 1 - cut)};
}

}  // namespace

LatentPlacement standingOnBase(const SplatCloud& cloud, double size) {
  const bool has_seen = std::any_of(cloud.opacities.begin(), cloud.opacities.end(),
                                    [](float opacity) { return opacity >= kLeastOpacity; });
  std::array<Extent, 3> sides;
  double largest = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    sides[axis] = extentOf(cloud, axis, has_seen ? kLeastOpacity : 0.0f);
    largest = std::max(largest, sides[axis].high - sides[axis].low);
  }
  LatentPlacement placement;
  if (!(largest > 0)) return placement;
  placement.scale = size / largest;
  for (size_t axis = 0; axis < 2; ++axis) {
    placement.offset[axis] = -placement.scale * (sides[axis].low + sides[axis].high) / 2;
  }
  placement.offset[2] = -placement.scale * sides[2].low;
  return placement;
}

}  // namespace stipple
