#include "fit/training/flow_objects.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stipple {
namespace {

/// Looks at the origin from a direction in the horizontal plane.
Camera lookingFrom(double yaw, double distance) {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = 200;
  camera.cx = camera.cy = 50;
  const Vec3d back(std::cos(yaw), std::sin(yaw), 0), right(-std::sin(yaw), std::cos(yaw), 0);
  camera.world_to_camera.block<1, 3>(0, 0) = right.transpose();
  camera.world_to_camera.block<1, 3>(1, 0) = Vec3d(0, 0, -1).transpose();
  camera.world_to_camera.block<1, 3>(2, 0) = -back.transpose();
  camera.world_to_camera.block<3, 1>(0, 3) =
      -camera.world_to_camera.block<3, 3>(0, 0) * (distance * back);
  return camera;
}

TEST(FlowObjects, ACameraIsItsDirectionDistanceAndWidth) {
  const std::array<float, 5> seen = flowCamera(lookingFrom(0.3, 4));
  EXPECT_NEAR(seen[0], std::cos(0.3), 1e-6);
  EXPECT_NEAR(seen[1], std::sin(0.3), 1e-6);
  EXPECT_NEAR(seen[2], 0, 1e-6);
  EXPECT_NEAR(seen[3], 0.25, 1e-6);
  EXPECT_NEAR(seen[4], 4 * 0.25, 1e-6);  // 50 pixels of 200 at a distance of 4
  Camera flat = lookingFrom(0.3, 4);
  flat.model = CameraModel::kOrthographic;
  const std::array<float, 5> orthographic = flowCamera(flat);
  EXPECT_NEAR(orthographic[0], std::cos(0.3), 1e-6);
  EXPECT_EQ(orthographic[3], 0.0f);
  EXPECT_NEAR(orthographic[4], 0.25, 1e-6);
}

TEST(FlowObjects, QuarterTurnsBringEveryCameraWithinAnEighthOfX) {
  for (int i = 0; i < 360; ++i) {
    const double yaw = (i + 0.5) * std::numbers::pi / 180;
    const int turns = quarterTurns(lookingFrom(yaw, 2));
    ASSERT_GE(turns, 0);
    ASSERT_LE(turns, 3);
    const double turned = std::remainder(yaw + turns * std::numbers::pi / 2, 2 * std::numbers::pi);
    EXPECT_LT(std::abs(turned), std::numbers::pi / 4 + 1e-6) << i;
  }
}

}  // namespace
}  // namespace stipple
