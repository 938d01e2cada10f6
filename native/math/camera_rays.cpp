#include "math/camera_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/cross_product.h"

namespace stipple {

namespace {

constexpr double kPi = std::numbers::pi;

/// Across a unit direction and horizontal; straight up and down any is.
Vec3d horizontalAcross(const Vec3d& direction) {
  const double length = std::hypot(direction[0], direction[2]);
  if (!(length > 1e-9)) return {1, 0, 0};
  return {direction[2] / length, 0, -direction[0] / length};
}

}  // namespace

CameraRays::CameraRays(const Camera& camera, const LensPoint& lens)
    : model_(camera.model),
      fx_(camera.fx),
      fy_(camera.fy),
      cx_(camera.cx),
      cy_(camera.cy),
      widest_(camera.field_of_view > 0 ? std::min(kPi, camera.field_of_view / 2) : kPi),
      lens_(lens),
      has_lens_(!hasImagePlane(camera) && (lens.x != 0 || lens.y != 0)) {}

bool CameraRays::lookAt(double x, double y, Vec3d& direction) const {
  if (model_ == CameraModel::kEquirectangular) {
    const double longitude = x, latitude = -y;
    if (std::abs(latitude) > kPi / 2) return false;
    const double flat = std::cos(latitude);
    direction = {flat * std::sin(longitude), -std::sin(latitude), flat * std::cos(longitude)};
    return true;
  }
  const double radius = std::hypot(x, y);
  double angle = radius;
  if (model_ == CameraModel::kFisheyeEquisolid) {
    if (radius > 2) return false;
    angle = 2 * std::asin(radius / 2);
  }
  if (angle > widest_) return false;
  // sin(a) / a is 1 to every digit where the radius is this small.
  const double across = radius > 1e-9 ? std::sin(angle) / radius : 1.0;
  direction = {across * x, across * y, std::cos(angle)};
  return true;
}

bool CameraRays::through(double x, double y, PixelRay& ray) const {
  const double right = (x - cx_) / fx_, down = (y - cy_) / fy_;
  if (model_ == CameraModel::kPerspective) {
    ray = {Vec3d::Zero(), {right, down, 1}};
    return true;
  }
  if (model_ == CameraModel::kOrthographic) {
    ray = {{right, down, 0}, {0, 0, 1}};
    return true;
  }
  ray.origin = Vec3d::Zero();
  if (!lookAt(right, down, ray.direction)) return false;
  if (has_lens_) {
    const Vec3d across = horizontalAcross(ray.direction);
    const Vec3d upright = crossProduct(ray.direction, across);
    ray.origin = lens_.x * across + lens_.y * upright;
    ray.direction = (lens_.focus_distance * ray.direction - ray.origin).normalized();
  }
  return true;
}

}  // namespace stipple
