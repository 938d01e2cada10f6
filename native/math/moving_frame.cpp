#include "math/moving_frame.h"

#include <algorithm>
#include <cmath>

#include "math/affine.h"
#include "math/principal_axes.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

Vec4d slerp(const Vec4d& from, Vec4d to, double share) {
  double cosine = from.dot(to);
  if (cosine < 0) {
    to = -to;
    cosine = -cosine;
  }
  const double angle = std::atan2((to - cosine * from).norm(), cosine);
  // sin(s a) / sin(a) is s to every digit below this angle.
  if (angle < 1e-8) return ((1 - share) * from + share * to).normalized();
  return (std::sin((1 - share) * angle) * from + std::sin(share * angle) * to) / std::sin(angle);
}

}  // namespace

MovingFrame::MovingFrame(std::span<const Mat4d> steps) {
  for (const Mat4d& matrix : steps) {
    const Mat3d linear = linearPart(matrix);
    Mat3d rotation = nearestOrthogonal(linear);
    if (determinant(rotation) < 0) rotation = -rotation;  // the rest mirrors
    steps_.push_back(
        {matrix, quaternionFromRotation(rotation), Mat3d(rotation.transpose() * linear)});
  }
}

Mat4d MovingFrame::at(double time) const {
  const double place = std::clamp(time, 0.0, 1.0) * static_cast<double>(steps_.size() - 1);
  const size_t first = std::min(static_cast<size_t>(place), steps_.size() - 1);
  const double share = place - static_cast<double>(first);
  const Step& a = steps_[first];
  if (share == 0) return a.matrix;
  const Step& b = steps_[first + 1];
  if (a.matrix == b.matrix) return a.matrix;
  const Vec4d quaternion = slerp(a.rotation, b.rotation, share);
  Mat4d made = Mat4d::Identity();
  made.topLeftCorner<3, 3>() = rotationFromQuaternion<double>(quaternion.data()) *
                               Mat3d((1 - share) * a.rest + share * b.rest);
  made.topRightCorner<3, 1>() =
      (1 - share) * translationPart(a.matrix) + share * translationPart(b.matrix);
  return made;
}

Mat4d rigidInverse(const Mat4d& matrix) {
  Mat4d made = Mat4d::Identity();
  const Mat3d turned = linearPart(matrix).transpose();
  made.topLeftCorner<3, 3>() = turned;
  made.topRightCorner<3, 1>() = -(turned * translationPart(matrix));
  return made;
}

}  // namespace stipple
