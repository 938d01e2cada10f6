#include "math/camera_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace stipple {

Vec3d fibonacciDirection(uint32_t index, uint32_t count) {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  const double z = 1 - (2.0 * index + 1) / count;
  const double ring = std::sqrt(std::max(0.0, 1 - z * z));
  const double angle = golden * index;
  return {ring * std::cos(angle), ring * std::sin(angle), z};
}

Camera cameraAlong(const Vec3d& eye, const Vec3d& forward, const Vec3d& up, double angle,
                   uint32_t size) {
  Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = 0.5 * size / std::tan(0.5 * angle);
  camera.cx = camera.cy = 0.5 * size;
  const Vec3d right = forward.cross(up).normalized();
  Mat3d rotation;
  rotation.row(0) = right;
  rotation.row(1) = forward.cross(right);
  rotation.row(2) = forward;
  camera.world_to_camera.topLeftCorner<3, 3>() = rotation;
  camera.world_to_camera.topRightCorner<3, 1>() = -rotation * eye;
  return camera;
}

}  // namespace stipple
