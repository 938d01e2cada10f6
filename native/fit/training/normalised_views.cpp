#include "fit/training/normalised_views.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"

namespace stipple {

namespace {

/// The camera that sees in the cube what `camera` sees around it.
Camera normalised(Camera camera, const LatentPlacement& placement) {
  requireImagePlane(camera, "learning from views of an object");
  const Vec3d offset(placement.offset[0], placement.offset[1], placement.offset[2]);
  const Vec3d middle = camera.world_to_camera.block<3, 3>(0, 0) * offset;
  for (int axis = 0; axis < 3; ++axis) {
    double& moved = camera.world_to_camera(axis, 3);
    moved = (moved + middle[axis]) / placement.scale;
  }
  camera.near_plane /= placement.scale;
  camera.far_plane /= placement.scale;
  if (camera.model == CameraModel::kOrthographic) {
    camera.fx *= placement.scale;
    camera.fy *= placement.scale;
  }
  return camera;
}

}  // namespace

LatentPlacement placementAround(const PointSet& points) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  float low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
  for (size_t i = 0; i < points.positions.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], points.positions[i]);
    high[i % 3] = std::max(high[i % 3], points.positions[i]);
  }
  LatentPlacement placement;
  double side = 0;
  for (size_t axis = 0; axis < 3 && !points.positions.empty(); ++axis) {
    side = std::max(side, static_cast<double>(high[axis]) - static_cast<double>(low[axis]));
    placement.offset[axis] =
        0.5 * (static_cast<double>(low[axis]) + static_cast<double>(high[axis]));
  }
  if (!(side > 0)) {
    fail(ErrorCode::kInvalidArgument,
         std::to_string(points.positions.size() / 3) +
             " points of the surface, which have no extent; two or more in different places are "
             "needed");
  }
  placement.scale = side / kNormalisedSide;
  return placement;
}

PointSet normalised(PointSet points, const LatentPlacement& placement) {
  const auto scale = static_cast<float>(placement.scale);
  for (size_t i = 0; i < points.positions.size(); ++i) {
    const auto offset = static_cast<float>(placement.offset[i % 3]);
    points.positions[i] = (points.positions[i] - offset) / scale;
  }
  points.areas.clear();  // They were in the world's metres, and nobody asks for them here.
  return points;
}

NormalisedViews::NormalisedViews(std::shared_ptr<const ViewSource> views)
    : views_(std::move(views)),
      placement_(placementAround(views_->points())),
      points_(normalised(views_->points(), placement_)) {
  for (size_t view = 0; view < views_->count(); ++view) {
    cameras_.push_back(normalised(views_->camera(view), placement_));
  }
}

}  // namespace stipple
