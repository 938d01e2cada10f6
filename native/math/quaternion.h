#pragma once

#include <algorithm>
#include <cmath>

#include "math/vec.h"

namespace stipple {

/// Rotation matrix of a quaternion w,x,y,z of any non-zero length.
template <typename T, typename Stored>
Eigen::Matrix<T, 3, 3> rotationFromQuaternion(const Stored* wxyz) {
  T w = T(wxyz[0]), x = T(wxyz[1]), y = T(wxyz[2]), z = T(wxyz[3]);
  // Dividing by the largest component first keeps the squares inside the range of T.
  const T largest =
      std::max(std::max(std::abs(w), std::abs(x)), std::max(std::abs(y), std::abs(z)));
  w /= largest;
  x /= largest;
  y /= largest;
  z /= largest;
  const T s = T(2) / (w * w + x * x + y * y + z * z);
  Eigen::Matrix<T, 3, 3> r;
  r << T(1) - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),  //
      s * (x * y + w * z), T(1) - s * (x * x + z * z), s * (y * z - w * x),   //
      s * (x * z - w * y), s * (y * z + w * x), T(1) - s * (x * x + y * y);
  return r;
}

/// Unit quaternion w,x,y,z, w >= 0, of a rotation matrix.
Vec4d quaternionFromRotation(const Mat3d& rotation);

}  // namespace stipple
