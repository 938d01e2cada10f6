#include "train/prior/shared_volume.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace stipple {

namespace {

/// Sine of half the angle that a camera sees, in its narrower direction; half a side, metres, of an
/// orthographic one.
double halfView(const Camera& camera) {
  const double half = std::min(0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy);
  return camera.model == CameraModel::kPerspective ? half / std::hypot(1.0, half) : half;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

Vec3d placeOf(const Camera& camera) {
  return camera.model == CameraModel::kPerspective ? cameraCentre(camera)
                                                   : unproject(camera, camera.cx, camera.cy, 0);
}

Vec3d axisOf(const Camera& camera) {
  return camera.world_to_camera.block<1, 3>(2, 0).transpose();
}

Vec3d unproject(const Camera& camera, double x, double y, double depth) {
  const double reach = camera.model == CameraModel::kPerspective ? depth : 1.0;
  const Vec3d at((x - camera.cx) / camera.fx * reach, (y - camera.cy) / camera.fy * reach, depth);
  return camera.world_to_camera.topLeftCorner<3, 3>().transpose() *
         (at - camera.world_to_camera.topRightCorner<3, 1>());
}

bool projectLocal(const Camera& camera, const Vec3d& at, double& x, double& y) {
  if (at[2] <= camera.near_plane) return false;
  const double reach = camera.model == CameraModel::kPerspective ? at[2] : 1.0;
  const double px = camera.fx * at[0] / reach + camera.cx;
  const double py = camera.fy * at[1] / reach + camera.cy;
  if (!(px >= 0 && py >= 0 && px < camera.width && py < camera.height)) return false;
  x = px;
  y = py;
  return true;
}

bool project(const Camera& camera, const Vec3d& place, double& x, double& y) {
  return projectLocal(camera,
                      camera.world_to_camera.topLeftCorner<3, 3>() * place +
                          camera.world_to_camera.topRightCorner<3, 1>(),
                      x, y);
}

SharedVolume sharedVolume(const std::vector<Camera>& cameras) {
  const double count = static_cast<double>(cameras.size());
  Vec3d mean = Vec3d::Zero(), mean_axis = Vec3d::Zero();
  for (const Camera& camera : cameras) {
    mean += placeOf(camera) / count;
    mean_axis += axisOf(camera) / count;
  }
  double extent = 0;
  for (const Camera& camera : cameras) {
    extent = std::max(extent, (placeOf(camera) - mean).norm());
  }
  const double unit = extent > 0 ? extent : 1.0;
  // Parallel axes have no nearest point: a weak pull ahead of all decides.
  constexpr double kPull = 1e-3;
  Mat3d sum = kPull * count * Mat3d::Identity();
  Vec3d right = kPull * count * (mean + unit * mean_axis);
  for (const Camera& camera : cameras) {
    const Vec3d axis = axisOf(camera);
    const Mat3d across = Mat3d::Identity() - axis * axis.transpose();
    sum += across;
    right += across * placeOf(camera);
  }
  const Vec3d centre = sum.ldlt().solve(right);
  std::vector<double> radii;
  size_t ahead = 0;
  for (const Camera& camera : cameras) {
    const double distance = (centre - placeOf(camera)).norm();
    radii.push_back(camera.model == CameraModel::kPerspective ? distance * halfView(camera)
                                                              : halfView(camera));
    double x = 0, y = 0;
    if (project(camera, centre, x, y)) ++ahead;
  }
  if (2 * ahead >= cameras.size()) return {centre, median(radii), (cameras.size() + 1) / 2, false};
  return {mean, 3 * unit, 1, true};
}

}  // namespace stipple
