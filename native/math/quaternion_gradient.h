#pragma once

#include <cmath>

#include "math/vec.h"

namespace stipple {

/// Gradient by a quaternion w,x,y,z of any non-zero length, through its normalisation, from the
/// gradient by the entries of rotationFromQuaternion. It is perpendicular to the quaternion and
/// grows as 1/length.
template <typename T, typename Stored>
Eigen::Matrix<T, 4, 1> rotationGradientToQuaternion(const Stored* wxyz,
                                                    const Eigen::Matrix<T, 3, 3>& by_rotation) {
  Eigen::Matrix<T, 4, 1> q;
  for (int k = 0; k < 4; ++k) q[k] = static_cast<T>(wxyz[k]);
  // Dividing by the largest component first keeps the squares inside the range of T.
  const T largest = q.cwiseAbs().maxCoeff();
  q /= largest;
  const T length = q.norm();
  q /= length;
  const T w = q[0], x = q[1], y = q[2], z = q[3];
  const auto& g = by_rotation;
  Eigen::Matrix<T, 4, 1> by_unit;
  by_unit[0] = z * (g(1, 0) - g(0, 1)) + y * (g(0, 2) - g(2, 0)) + x * (g(2, 1) - g(1, 2));
  by_unit[1] = y * (g(0, 1) + g(1, 0)) + z * (g(0, 2) + g(2, 0)) + w * (g(2, 1) - g(1, 2)) -
               T(2) * x * (g(1, 1) + g(2, 2));
  by_unit[2] = x * (g(0, 1) + g(1, 0)) + z * (g(1, 2) + g(2, 1)) + w * (g(0, 2) - g(2, 0)) -
               T(2) * y * (g(0, 0) + g(2, 2));
  by_unit[3] = x * (g(0, 2) + g(2, 0)) + y * (g(1, 2) + g(2, 1)) + w * (g(1, 0) - g(0, 1)) -
               T(2) * z * (g(0, 0) + g(1, 1));
  by_unit *= T(2);
  by_unit -= q * q.dot(by_unit);
  return by_unit / length / largest;
}

}  // namespace stipple
