#pragma once

#include <cstddef>
#include <vector>

#include "math/camera.h"

namespace stipple {

/// Of any camera; of an orthographic one, the middle of the plane that it looks from.
Vec3d placeOf(const Camera& camera);

/// Unit direction of sight, world.
Vec3d axisOf(const Camera& camera);

/// World place that a pixel coordinate shows at a planar depth, metres.
Vec3d unproject(const Camera& camera, double x, double y, double depth);

/// Pixel coordinates of a world place. Returns: whether it is before the camera and inside its
/// picture; if not, x and y are as they were.
bool project(const Camera& camera, const Vec3d& place, double& x, double& y);

/// The same of a place in the camera's own frame.
bool projectLocal(const Camera& camera, const Vec3d& place, double& x, double& y);

struct SharedVolume {
  Vec3d centre = Vec3d::Zero();
  double radius = 1;       ///< metres
  size_t least_views = 1;  ///< that see what counts as inside
  bool is_around = false;  ///< cameras look away from each other, the volume is around them
};

/// What cameras look at: a ball around the point nearest to all their axes, as large as most of
/// them see whole. Cameras that look away from each other have the room around them in common.
/// In: cameras, at least one.
SharedVolume sharedVolume(const std::vector<Camera>& cameras);

}  // namespace stipple
