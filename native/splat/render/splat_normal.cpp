#include "splat/render/splat_normal.h"

#include <cmath>
#include <utility>

#include "math/covariance.h"
#include "math/principal_axes.h"

namespace stipple {

namespace {

/// Whether the columns stand upright on each other and none is 0: then they are the axes.
bool areAxes(const Mat3d& matrix, const Vec3d& lengths) {
  constexpr double kRounding = 1e-12;
  for (const auto& [i, j] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
    const double slack = kRounding * lengths[i] * lengths[j];
    if (!(std::abs(matrix.col(i).dot(matrix.col(j))) <= slack && slack > 0)) return false;
  }
  return true;
}

/// Of the ellipsoid that the matrix makes of the unit sphere. Unit.
Vec3d shortestAxis(const Mat3d& matrix) {
  Eigen::Index shortest;
  const Vec3d lengths = matrix.colwise().norm();
  if (areAxes(matrix, lengths)) {
    const double length = lengths.minCoeff(&shortest);
    return matrix.col(shortest) / length;
  }
  const PrincipalAxes ellipsoid = principalAxes(matrix);
  ellipsoid.lengths.minCoeff(&shortest);
  return ellipsoid.axes.col(shortest);
}

}  // namespace

Vec3d splatNormal(const PlacedScene& scene, const PlacedCloud& placed, size_t index) {
  const SplatCloud& cloud = *placed.cloud;
  const Vec3d axis = shortestAxis(
      placed.linear * scaledAxes<double>(&cloud.rotations[index * 4], &cloud.scales[index * 3]));
  const float* position = &cloud.positions[index * 3];
  const Vec3d centre =
      placed.linear * Vec3d(position[0], position[1], position[2]) + placed.translation;
  const double away = scene.view.perspective ? axis.dot(centre) : axis[2];
  return scene.view_to_world * (away > 0 ? Vec3d(-axis) : axis);
}

}  // namespace stipple
