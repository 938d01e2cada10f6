#include "math/ray_meeting.h"

#include <Eigen/Cholesky>

namespace stipple {

std::optional<Vec3d> nearestToLines(std::span<const Line> lines) {
  Mat3d matrix = Mat3d::Zero();
  Vec3d right = Vec3d::Zero();
  for (const Line& line : lines) {
    const Mat3d across = Mat3d::Identity() - line.direction * line.direction.transpose();
    matrix += across;
    right += across * line.place;
  }
  const Eigen::LDLT<Mat3d> solver(matrix);
  // The smallest pivot of n lines is about n times the square of the angles between them.
  constexpr double kLeastAngle = 0.01;
  const double least = kLeastAngle * kLeastAngle * static_cast<double>(lines.size());
  if (!(solver.vectorD().minCoeff() > least)) return std::nullopt;
  return Vec3d(solver.solve(right));
}

}  // namespace stipple
