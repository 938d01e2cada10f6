#include "fit/training/normalised_views.h"

#include <gtest/gtest.h>

#include <memory>

#include "base/error.h"
#include "data/views/memory_view_source.h"

namespace stipple {
namespace {

Vec3d pixelOf(const Camera& camera, const Vec3d& place) {
  const Vec4d seen = camera.world_to_camera * Vec4d(place[0], place[1], place[2], 1);
  const double depth = camera.model == CameraModel::kOrthographic ? 1 : seen[2];
  return {camera.fx * seen[0] / depth + camera.cx, camera.fy * seen[1] / depth + camera.cy,
          seen[2]};
}

class OneView final : public ViewSource {
 public:
  size_t count() const override { return 1; }
  const Camera& camera(size_t) const override { return seen_by; }
  std::string name(size_t) const override { return "one"; }
  ColourSpace colourSpace() const override { return ColourSpace::kDisplay; }
  ViewPicture load(size_t) const override { return {}; }
  const PointSet& points() const override { return surface; }

  Camera seen_by;
  PointSet surface;
};

std::shared_ptr<OneView> farAway(CameraModel model) {
  auto view = std::make_shared<OneView>();
  Camera& camera = view->seen_by;
  camera.model = model;
  camera.width = camera.height = 64;
  camera.fx = camera.fy = 80;
  camera.cx = 30;
  camera.cy = 33;
  camera.world_to_camera.block<3, 3>(0, 0) << 0, 1, 0, 0, 0, -1, -1, 0, 0;
  camera.world_to_camera.block<3, 1>(0, 3) << 20, 5, 130;
  view->surface.positions = {100, -20, 3, 104, -18, 4, 101, -21, 9};
  return view;
}

TEST(NormalisedViews, PointsFillTheCubeAndAreSeenWhereTheyWere) {
  for (const CameraModel model : {CameraModel::kPerspective, CameraModel::kOrthographic}) {
    const std::shared_ptr<OneView> given = farAway(model);
    const NormalisedViews views(given);
    const LatentPlacement& back = views.placement();
    EXPECT_NEAR(back.scale, 6 / kNormalisedSide, 1e-6);
    double most = 0;
    for (size_t i = 0; i < 3; ++i) {
      Vec3d was, is, again;
      for (int axis = 0; axis < 3; ++axis) {
        const size_t at = i * 3 + static_cast<size_t>(axis);
        was[axis] = static_cast<double>(given->surface.positions[at]);
        is[axis] = static_cast<double>(views.points().positions[at]);
        again[axis] = back.scale * is[axis] + back.offset[static_cast<size_t>(axis)];
        most = std::max(most, std::abs(is[axis]));
      }
      EXPECT_LT((again - was).norm(), 1e-4);
      const Vec3d before = pixelOf(given->seen_by, was), after = pixelOf(views.camera(0), is);
      // Floats of points are off by 1e-7 of their size, which 80 pixels' focal length enlarges.
      EXPECT_NEAR(after[0], before[0], 1e-3);
      EXPECT_NEAR(after[1], before[1], 1e-3);
      EXPECT_NEAR(after[2] * back.scale, before[2], 1e-4);
    }
    EXPECT_NEAR(most, kNormalisedSide / 2, 1e-5);
  }
}

TEST(NormalisedViews, WhatHasNoExtentOrNoPlaneIsRefused) {
  const std::shared_ptr<OneView> one = farAway(CameraModel::kPerspective);
  one->surface.positions = {1, 2, 3, 1, 2, 3};
  EXPECT_THROW(NormalisedViews{one}, Error);
  one->surface.positions.clear();
  EXPECT_THROW(NormalisedViews{one}, Error);
  EXPECT_THROW(NormalisedViews{farAway(CameraModel::kEquirectangular)}, Error);
}

}  // namespace
}  // namespace stipple
