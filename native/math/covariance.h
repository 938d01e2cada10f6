#pragma once

#include "math/quaternion.h"
#include "math/vec.h"

namespace stipple {

/// Columns are the splat's axes times its standard deviations, metres; the covariance is A A^T.
/// In: rotation w,x,y,z of any non-zero length; scales [3] linear standard deviations.
template <typename T>
Eigen::Matrix<T, 3, 3> scaledAxes(const float* rotation, const float* scales) {
  Eigen::Matrix<T, 3, 3> axes = rotationFromQuaternion<T>(rotation);
  for (int column = 0; column < 3; ++column) axes.col(column) *= T(scales[column]);
  return axes;
}

/// Object-space covariance, m^2.
template <typename T>
Eigen::Matrix<T, 3, 3> covariance(const float* rotation, const float* scales) {
  const Eigen::Matrix<T, 3, 3> axes = scaledAxes<T>(rotation, scales);
  return axes * axes.transpose();
}

}  // namespace stipple
