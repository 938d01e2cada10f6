#include "math/camera.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"
#include "base/number_text.h"

namespace stipple {

namespace {

constexpr uint32_t kMaxSide = 65536;
/// Limits that keep every product of the projection inside double; pictures need far less.
constexpr double kMaxFocal = 1e9;
constexpr double kMaxCentre = 1e12;    // pixels; a shifted lens of a kilometre has 1e9
constexpr double kMaxDistance = 1e24;  // metres; the hard cases of tests have 2e18
constexpr double kMinNear = 1e-9;

/// Refuses what is not finite, too, without comparing it, which would trap where traps are on.
void requireAtMost(double value, double limit, const char* name) {
  if (std::isfinite(value) && std::abs(value) <= limit) return;
  fail(ErrorCode::kInvalidArgument, std::string(name) + " is " + numberText(value) +
                                        "; finite numbers from " + numberText(-limit) + " to " +
                                        numberText(limit) + " are allowed");
}

/// A pixel more than the whole sphere: sizes are rounded.
void requireWithin(double pixels, double per_radian, double limit, const char* side) {
  if (pixels <= limit * per_radian + 1) return;
  constexpr double kDegrees = 180 / std::numbers::pi;
  fail(ErrorCode::kInvalidArgument,
       std::string("the panorama is ") + numberText(pixels / per_radian * kDegrees) + " degrees " +
           side + "; at most " + numberText(limit * kDegrees) + " is allowed");
}

void requireFieldOfView(const Camera& camera) {
  requireFinite(camera.field_of_view, "camera.field_of_view");
  const double limit = 2 * std::numbers::pi;
  switch (camera.model) {
    case CameraModel::kEquirectangular:
      requireWithin(camera.width, camera.fx, limit, "wide");
      requireWithin(camera.height, camera.fy, limit / 2, "high");
      [[fallthrough]];
    case CameraModel::kPerspective:
    case CameraModel::kOrthographic:
      if (camera.field_of_view == 0) return;
      fail(ErrorCode::kInvalidArgument,
           "camera.field_of_view is " + numberText(camera.field_of_view) +
               "; it is that of fisheyes, for other cameras 0 is allowed");
    case CameraModel::kFisheyeEquidistant:
    case CameraModel::kFisheyeEquisolid:
      // A little more: 360 degrees in single precision.
      if (camera.field_of_view >= 0 && camera.field_of_view <= limit * (1 + 1e-6)) return;
      fail(ErrorCode::kInvalidArgument,
           "the fisheye's field of view is " +
               numberText(camera.field_of_view * 180 / std::numbers::pi) +
               " degrees; 0 to 360 is allowed");
  }
  fail(ErrorCode::kInvalidArgument, "camera.model is " +
                                        std::to_string(static_cast<uint32_t>(camera.model)) +
                                        "; 0 to 4 is allowed");
}

void requireRigid(const Mat4d& matrix) {
  const Mat3d rotation = matrix.topLeftCorner<3, 3>();
  // 1e-4: a matrix that went through float32 and a JSON file is off by about 1e-6.
  const double error = (rotation * rotation.transpose() - Mat3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < 1e-4) || rotation.determinant() < 0) {
    fail(ErrorCode::kInvalidArgument,
         "camera.world_to_camera is not a rotation and a translation (it differs by " +
             numberText(error) + " from orthonormal; at most 0.0001 is allowed)");
  }
  const Eigen::Matrix<double, 1, 4> last(0, 0, 0, 1);
  if (matrix.row(3) != last) {
    fail(ErrorCode::kInvalidArgument, "camera.world_to_camera must end with the row 0 0 0 1");
  }
}

}  // namespace

void validate(const Camera& camera) {
  for (const uint32_t side : {camera.width, camera.height}) {
    if (side < 1 || side > kMaxSide) {
      fail(ErrorCode::kInvalidArgument, "camera is " + std::to_string(camera.width) + " x " +
                                            std::to_string(camera.height) +
                                            " pixels; each side must be 1 to 65536");
    }
  }
  for (const double focal : {camera.fx, camera.fy}) {
    if (!std::isfinite(focal) || focal <= 0 || focal > kMaxFocal) {
      fail(ErrorCode::kInvalidArgument, "camera focal length is " + numberText(focal) +
                                            " pixels; it must be positive and at most 1e9");
    }
  }
  requireAtMost(camera.cx, kMaxCentre, "camera.cx");
  requireAtMost(camera.cy, kMaxCentre, "camera.cy");
  for (Eigen::Index i = 0; i < 16; ++i) {
    requireFinite(camera.world_to_camera.data()[i], "camera.world_to_camera");
  }
  requireRigid(camera.world_to_camera);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    requireAtMost(camera.world_to_camera(axis, 3), kMaxDistance,
                  "the translation of camera.world_to_camera");
  }
  requireFinite(camera.near_plane, "camera.near_plane");
  requireFinite(camera.far_plane, "camera.far_plane");
  const bool is_orthographic = camera.model == CameraModel::kOrthographic;
  if (!(camera.far_plane > camera.near_plane) ||
      (!is_orthographic && !(camera.near_plane >= kMinNear))) {
    fail(ErrorCode::kInvalidArgument,
         "camera near and far planes are " + std::to_string(camera.near_plane) + " and " +
             std::to_string(camera.far_plane) + " m; 1e-9 <= near < far is needed");
  }
  requireFieldOfView(camera);
}

void requireImagePlane(const Camera& camera, const char* who) {
  if (hasImagePlane(camera)) return;
  const char* model = camera.model == CameraModel::kEquirectangular      ? "equirectangular"
                      : camera.model == CameraModel::kFisheyeEquidistant ? "fisheye equidistant"
                                                                         : "fisheye equisolid";
  fail(ErrorCode::kInvalidArgument, std::string(who) +
                                        " needs a perspective or orthographic camera; "
                                        "this one is " +
                                        model + ", which is drawn along rays only");
}

Camera enlarged(Camera camera, uint32_t factor) {
  camera.width *= factor;
  camera.height *= factor;
  for (double* number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *number *= factor;
  return camera;
}

Camera reduced(Camera camera, uint32_t factor) {
  camera.width /= factor;
  camera.height /= factor;
  for (double* number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *number /= factor;
  return camera;
}

Vec3d cameraCentre(const Camera& camera) {
  const Mat3d rotation = camera.world_to_camera.topLeftCorner<3, 3>();
  return -(rotation.transpose() * camera.world_to_camera.topRightCorner<3, 1>());
}

}  // namespace stipple
