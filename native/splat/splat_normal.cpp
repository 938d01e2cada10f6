#include "splat/splat_normal.h"

#include "math/covariance.h"
#include "math/principal_axes.h"

namespace stipple {

Vec3d splatNormal(const PlacedScene& scene, const PlacedCloud& placed, size_t index) {
  const SplatCloud& cloud = *placed.cloud;
  const PrincipalAxes ellipsoid = principalAxes(
      placed.linear * scaledAxes<double>(&cloud.rotations[index * 4], &cloud.scales[index * 3]));
  Eigen::Index shortest;
  ellipsoid.lengths.minCoeff(&shortest);
  const Vec3d axis = ellipsoid.axes.col(shortest);
  const float* position = &cloud.positions[index * 3];
  const Vec3d centre =
      placed.linear * Vec3d(position[0], position[1], position[2]) + placed.translation;
  const double away = scene.view.perspective ? axis.dot(centre) : axis[2];
  return scene.view_to_world * (away > 0 ? Vec3d(-axis) : axis);
}

}  // namespace stipple
