#include "data/clouds/splat_quantities.h"

#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

void splitAxis(const SplatCloud& cloud, size_t row, float* axis) {
  const float* scales = &cloud.scales[row * 3];
  const Eigen::Index longest = std::max_element(scales, scales + 3) - scales;
  const double length = static_cast<double>(scales[longest]);
  const double second =
      static_cast<double>(std::max(scales[(longest + 1) % 3], scales[(longest + 2) % 3]));
  const double clearness = length > 0 ? 1 - second / length : 0;
  const Vec3d column =
      rotationFromQuaternion<double>(&cloud.rotations[row * 4]).col(longest) * clearness;
  for (Eigen::Index k = 0; k < 3; ++k) axis[k] = static_cast<float>(column[k]);
}

}  // namespace

const std::vector<float>& SplatQuantities::of(SplatQuantity quantity) const {
  switch (quantity) {
    case SplatQuantity::kScore:
      return score;
    case SplatQuantity::kAge:
      return age;
    case SplatQuantity::kContribution:
      return contribution;
    case SplatQuantity::kSplitAxis:
      break;
  }
  fail(ErrorCode::kInternal, "this quantity of splats is not kept");
}

std::vector<float> splitAxes(const SplatCloud& cloud) {
  std::vector<float> axes(cloud.size() * 3);
  parallelFor(cloud.size(), 16384, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) splitAxis(cloud, i, &axes[i * 3]);
  });
  return axes;
}

}  // namespace stipple
