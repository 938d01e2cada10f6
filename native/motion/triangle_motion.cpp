#include "motion/triangle_motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "math/principal_axes.h"

namespace stipple {

namespace {

Vec3d cornerAt(std::span<const float> positions, uint32_t vertex) {
  const float* at = positions.data() + size_t{3} * vertex;
  return {at[0], at[1], at[2]};
}

std::array<float, 9> entriesOf(const Mat3d& matrix) {
  std::array<float, 9> entries;
  for (size_t i = 0; i < 9; ++i) {
    entries[i] = static_cast<float>(
        matrix(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)));
  }
  return entries;
}

}  // namespace

TriangleFrame triangleFrame(std::span<const float> positions, const uint32_t* corners) {
  const Vec3d origin = cornerAt(positions, corners[0]);
  TriangleFrame frame;
  frame.axes.col(0) = cornerAt(positions, corners[1]) - origin;
  frame.axes.col(1) = cornerAt(positions, corners[2]) - origin;
  const Vec3d normal = frame.axes.col(0).cross(frame.axes.col(1));
  frame.area = normal.norm();
  frame.axes.col(2) = frame.area > 0 ? Vec3d(normal / frame.area) : Vec3d::Zero();
  return frame;
}

Mat3d boundedStretch(const Mat3d& linear) {
  // Where no stretch can be beyond the bounds, nothing is to be done: the sum of squares is above
  // the largest one's, and the determinant over the two largest below the smallest one.
  const double squared = linear.squaredNorm();
  const double determinant = linear.determinant();
  if (squared <= kLargestStretch * kLargestStretch && determinant > 0 &&
      determinant >= squared / 2 / kLargestStretch) {
    return linear;
  }
  PrincipalAxes axes = principalAxes(linear);
  for (int i = 0; i < 3; ++i) {
    axes.lengths[i] = std::clamp(axes.lengths[i], 1 / kLargestStretch, kLargestStretch);
  }
  Mat3d turn = axes.turn;
  if (turn.determinant() < 0) {
    // A map that turns inside out is one that flattens, as far as shapes go.
    Eigen::Index smallest = 0;
    axes.lengths.minCoeff(&smallest);
    turn.col(smallest) = -turn.col(smallest);
  }
  return axes.axes * axes.lengths.asDiagonal() * turn.transpose();
}

TriangleMotion triangleMotion(std::span<const float> rest, std::span<const float> deformed,
                              const uint32_t* corners) {
  const TriangleFrame before = triangleFrame(rest, corners);
  TriangleFrame after = triangleFrame(deformed, corners);
  after.axes.col(2) *= std::sqrt(after.area / before.area);
  const Mat3d linear = after.axes * before.axes.inverse();
  TriangleMotion motion;
  const Vec3d from = cornerAt(rest, corners[0]), to = cornerAt(deformed, corners[0]);
  for (size_t axis = 0; axis < 3; ++axis) {
    motion.rest[axis] = static_cast<float>(from[static_cast<Eigen::Index>(axis)]);
    motion.place[axis] = static_cast<float>(to[static_cast<Eigen::Index>(axis)]);
  }
  motion.linear = entriesOf(linear);
  motion.shape = entriesOf(boundedStretch(linear));
  return motion;
}

}  // namespace stipple
