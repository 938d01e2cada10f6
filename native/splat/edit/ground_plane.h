#pragma once

#include <cstdint>
#include <optional>

#include "data/clouds/splat_cloud.h"
#include "math/vec.h"

namespace stipple {

/// Points p with normal . p = offset.
struct Plane {
  Vec3d normal = Vec3d::UnitZ();  ///< unit, upwards
  double offset = 0;              ///< metres
};

struct GroundPlaneOptions {
  Vec3d up = Vec3d::UnitZ();  ///< roughly upwards, any length; 0: unknown, any tilt is allowed
  double max_tilt = 0.7853981633974483;  ///< radians between `up` and the plane's normal
  /// Distance to the plane at which a splat belongs to it, metres. Automatic: 0.5 % of the middle
  /// 80 % of the cloud's extent.
  std::optional<double> tolerance;
  uint64_t seed = 0;
};

struct GroundPlane {
  Plane plane;
  uint64_t considered_count = 0;  ///< splats looked at: at most 50,000, solid ones where possible
  uint64_t inlier_count = 0;      ///< of those, in the plane
  double tolerance = 0;           ///< metres
  /// The box of the middle 98 % of the splats looked at, along each axis of the frame that
  /// levelling() leads to, metres.
  Vec3d extent_min = Vec3d::Zero();
  Vec3d extent_max = Vec3d::Zero();
};

/// The plane that most of the surface lies in while little lies below it: the floor rather than a
/// ceiling, a wall or a table. Splats count by the area that they cover, within bounds.
/// In: cloud_to_world: the frame of `up` and of the result; affine.
/// Errors: kInvalidArgument for fewer than three splats, options out of range, a cloud that
/// validate() refuses, and where no three splats make a plane within max_tilt.
/// Determinism: by the seed, for any number of threads.
GroundPlane groundPlane(const SplatCloud& cloud, const Mat4d& cloud_to_world,
                        const GroundPlaneOptions& options);

/// The plane through three points, its normal on the side of `up`.
/// Errors: kInvalidArgument for points on one line or values that are not finite.
Plane planeThrough(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& up);

/// The smallest turn that makes the plane horizontal, then the move along z that puts it at z = 0:
/// rigid, to apply to whatever lies in the plane.
Mat4d levelling(const Plane& plane);

/// Uniform scale about the world's origin that makes the distance from a to b the given length.
/// Errors: kInvalidArgument for equal points, a length that is not positive, values that are not
/// finite.
Mat4d scalingTo(const Vec3d& a, const Vec3d& b, double length);

}  // namespace stipple
