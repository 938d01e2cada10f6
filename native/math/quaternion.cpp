#include "math/quaternion.h"

#include <Eigen/Geometry>

namespace stipple {

Vec4d quaternionFromRotation(const Mat3d& rotation) {
  Eigen::Quaterniond q(rotation);
  q.normalize();
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  return {sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z()};
}

}  // namespace stipple
