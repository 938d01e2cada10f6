#include "train/loop/view_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/error.h"
#include "base/random.h"
#include "data/clouds/cloud_extent.h"
#include "math/camera_rig.h"
#include "math/quaternion.h"

namespace stipple {

namespace {

/// Places of cameras inside lie within this share of the radius.
constexpr double kInsideShare = 0.25;
/// Of this many places the one farthest from everything is taken: a camera with its nose to a wall
/// sees a few splats only, and those far larger than anybody looks at them.
constexpr uint32_t kPlacesToTry = 16;
/// At most this many splats are asked, and one in so many of them may be nearer: floaters.
constexpr size_t kSplatsToAsk = 8192;
constexpr size_t kMayBeNearer = 256;
/// Nothing within this many radii is cut off behind.
constexpr double kFarRadii = 1e3;
/// Views from around, and places inside, of a hollow cloud: of ten views.
constexpr uint32_t kHollowShare = 4;
/// Faces of the cube around a place have this many of a view's 25 pixels.
constexpr uint32_t kFacePixels = 16;
constexpr uint32_t kProbeSize = 48;
constexpr double kProbeDepthShare = 0.3;

Camera lookingAlong(const Vec3d& eye, const Vec3d& forward, double angle, uint32_t size,
                    double radius) {
  const Vec3d aside = std::abs(forward[1]) < 0.9 ? Vec3d(0, 1, 0) : Vec3d(1, 0, 0);
  Camera camera = cameraAlong(eye, forward, aside, angle, size);
  camera.near_plane = std::max(1e-3 * radius, 1e-9);
  camera.far_plane = std::max(camera.far_plane, kFarRadii * radius);
  return camera;
}

/// Uniform turns of the whole sphere (Shoemake, Uniform Random Rotations, Graphics Gems III).
Mat3d turnOf(uint64_t seed) {
  double u[3];
  for (uint64_t k = 0; k < 3; ++k) u[k] = unitDouble(keyedBits(seed, RandomUse::kViewRig, k));
  constexpr double kTurn = 2 * std::numbers::pi;
  const double a = std::sqrt(1 - u[0]);
  const double b = std::sqrt(u[0]);
  const double quaternion[4] = {a * std::sin(kTurn * u[1]), a * std::cos(kTurn * u[1]),
                                b * std::sin(kTurn * u[2]), b * std::cos(kTurn * u[2])};
  return rotationFromQuaternion<double>(quaternion);
}

Vec3d direction(const Mat3d& turn, uint32_t index, uint32_t count) {
  return (turn * fibonacciDirection(index, count)).normalized();
}

Vec3d centreOf(const CloudExtent& extent) {
  return {extent.centre[0], extent.centre[1], extent.centre[2]};
}

/// A place near the middle with room around it. Other indices give other places.
Vec3d insidePlace(const SplatCloud& cloud, const CloudExtent& extent, uint64_t seed,
                  uint32_t index) {
  const size_t stride = (cloud.size() + kSplatsToAsk - 1) / kSplatsToAsk;
  std::vector<double> squared((cloud.size() + stride - 1) / stride);
  const auto kept = squared.begin() + static_cast<ptrdiff_t>(squared.size() / kMayBeNearer);
  Vec3d best = centreOf(extent);
  double farthest = -1;
  for (uint32_t attempt = 0; attempt < kPlacesToTry; ++attempt) {
    Vec3d place = centreOf(extent);
    for (uint64_t axis = 0; axis < 3; ++axis) {
      const uint64_t key = 3 + (uint64_t{index} * kPlacesToTry + attempt) * 3 + axis;
      const double u = unitDouble(keyedBits(seed, RandomUse::kViewRig, key));
      place[static_cast<int>(axis)] += kInsideShare * extent.radius * (2 * u - 1);
    }
    for (size_t i = 0; i < squared.size(); ++i) {
      const float* p = &cloud.positions[i * stride * 3];
      squared[i] = (Vec3d(p[0], p[1], p[2]) - place).squaredNorm();
    }
    std::nth_element(squared.begin(), kept, squared.end());
    if (*kept <= farthest) continue;
    farthest = *kept;
    best = place;
  }
  return best;
}

void validate(const SplatCloud& cloud, const ViewRigOptions& options) {
  if (cloud.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "the cloud has 0 splats; views need at least 1");
  }
  if (options.count < 1 || options.count > 4096 || options.size < 1 || options.size > 65536) {
    fail(ErrorCode::kInvalidArgument,
         "the view rig has " + std::to_string(options.count) + " views of " +
             std::to_string(options.size) +
             " pixels; 1 to 4096 views of 1 to 65536 pixels are allowed");
  }
}

/// Looks along axis face / 2, backwards where the face is odd.
Camera cubeFace(const Vec3d& eye, int face, uint32_t size, double radius) {
  Vec3d forward = Vec3d::Zero();
  forward[face / 2] = face % 2 == 0 ? 1 : -1;
  return lookingAlong(eye, forward, 0.5 * std::numbers::pi, size, radius);
}

Camera viewFromAround(const CloudExtent& extent, const Vec3d& outward, uint32_t size) {
  const double distance = extent.radius / std::sin(0.5 * kAngleAround);
  return lookingAlong(centreOf(extent) + distance * outward, -outward, kAngleAround, size,
                      extent.radius);
}

}  // namespace

ViewRig chooseRig(const BackendFactory& backends, const SplatCloud& cloud) {
  const CloudExtent extent = cloudExtent(cloud);
  RenderOptions options;
  options.with_depth = true;
  const SplatInstance instance{&cloud};
  const std::unique_ptr<ImageRenderer> images = backends.makeImageRenderer();
  RenderResult result;
  uint64_t far_count = 0;
  uint64_t pixel_count = 0;
  for (int face = 0; face < 6; ++face) {
    const Camera camera = cubeFace(centreOf(extent), face, kProbeSize, extent.radius);
    images->render({&instance, 1}, camera, options, {}, result);
    for (size_t i = 0; i < result.depth.size(); ++i) {
      const bool covered = result.colour[i * 4 + 3] > 0.5f;
      const bool far = static_cast<double>(result.depth[i]) > kProbeDepthShare * extent.radius;
      far_count += covered && far ? 1 : 0;
    }
    pixel_count += result.depth.size();
  }
  return 2 * far_count >= pixel_count ? ViewRig::kInside : ViewRig::kAround;
}

std::vector<Camera> viewsOfCloud(const BackendFactory& backends, const SplatCloud& cloud,
                                 const ViewRigOptions& options) {
  validate(cloud, options);
  // A hollow thing, as a mesh becomes, and a room are alike from their middle: seen both ways.
  const bool is_automatic = options.rig == ViewRig::kAutomatic;
  const bool is_hollow = is_automatic && chooseRig(backends, cloud) == ViewRig::kInside;
  const CloudExtent extent = cloudExtent(cloud);
  const Mat3d turn = turnOf(options.seed);
  std::vector<Camera> cameras;
  for (uint32_t i = 0; i < options.count; ++i) {
    const Vec3d outward = direction(turn, i, options.count);
    // Two of a kind in turn: who draws every second view in another way gets both kinds.
    const ViewRig automatic = is_hollow && i / 2 % 2 == 1 ? ViewRig::kInside : ViewRig::kAround;
    const ViewRig rig = is_automatic ? automatic : options.rig;
    if (rig == ViewRig::kAround) {
      cameras.push_back(viewFromAround(extent, outward, options.size));
    } else {
      const Vec3d eye = insidePlace(cloud, extent, options.seed, i);
      cameras.push_back(lookingAlong(eye, outward, kAngleInside, options.size, extent.radius));
    }
  }
  return cameras;
}

std::vector<Camera> viewsForVisibility(const BackendFactory& backends, const SplatCloud& cloud,
                                       const ViewRigOptions& options) {
  validate(cloud, options);
  ViewRig rig = options.rig;
  const bool is_hollow =
      rig == ViewRig::kAutomatic && chooseRig(backends, cloud) == ViewRig::kInside;
  if (rig == ViewRig::kAutomatic && !is_hollow) rig = ViewRig::kAround;
  const CloudExtent extent = cloudExtent(cloud);
  const uint32_t share = (options.count * kHollowShare + 9) / 10;
  const uint32_t around_count = rig == ViewRig::kAround   ? options.count
                                : rig == ViewRig::kInside ? 0
                                                          : share;
  const uint32_t place_count = rig == ViewRig::kAround ? 0 : share;
  const Mat3d turn = turnOf(options.seed);
  std::vector<Camera> cameras;
  for (uint32_t i = 0; i < around_count; ++i) {
    cameras.push_back(viewFromAround(extent, direction(turn, i, around_count), options.size));
  }
  const uint32_t face_size = (options.size * kFacePixels + 24) / 25;
  for (uint32_t i = 0; i < place_count; ++i) {
    const Vec3d eye = insidePlace(cloud, extent, options.seed, i);
    for (int face = 0; face < 6; ++face) {
      cameras.push_back(cubeFace(eye, face, face_size, extent.radius));
    }
  }
  return cameras;
}

}  // namespace stipple
