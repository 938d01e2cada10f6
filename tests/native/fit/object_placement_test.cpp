#include "fit/object_placement.h"

#include <gtest/gtest.h>

namespace stipple {
namespace {

SplatCloud cloudOf(std::vector<float> positions, std::vector<float> opacities) {
  SplatCloud cloud;
  cloud.positions = std::move(positions);
  cloud.opacities = std::move(opacities);
  cloud.rotations.assign(cloud.opacities.size() * 4, 0.5f);
  cloud.scales.assign(cloud.opacities.size() * 3, 0.01f);
  cloud.sh.assign(cloud.opacities.size() * 3, 0.0f);
  return cloud;
}

TEST(ObjectPlacement, PutsTheMiddleOfTheBaseIntoTheOrigin) {
  // Sides of 0.2, 0.4 and 0.8.
  const SplatCloud cloud = cloudOf({0.1f, -0.2f, -0.4f, 0.3f, 0.2f, 0.4f}, {1, 1});
  const LatentPlacement placement = standingOnBase(cloud, 2.0);
  EXPECT_NEAR(placement.scale, 2.5, 1e-6);
  EXPECT_NEAR(placement.offset[0], -0.5, 1e-6);
  EXPECT_NEAR(placement.offset[1], 0.0, 1e-6);
  EXPECT_NEAR(placement.offset[2], 1.0, 1e-6);
}

TEST(ObjectPlacement, PassesOverFaintSplatsAndSingleOnesThatFlyOff) {
  std::vector<float> positions, opacities;
  for (int i = 0; i < 1000; ++i) {
    for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(i % 2) - 0.5f);
    opacities.push_back(1.0f);
  }
  positions.insert(positions.end(), {9, 9, 9});
  opacities.push_back(1.0f);
  for (int i = 0; i < 100; ++i) {
    positions.insert(positions.end(), {-7, -7, -7});
    opacities.push_back(0.01f);
  }
  const LatentPlacement placement = standingOnBase(cloudOf(positions, opacities), 1.0);
  EXPECT_NEAR(placement.scale, 1.0, 1e-6);
  EXPECT_NEAR(placement.offset[2], 0.5, 1e-6);
}

TEST(ObjectPlacement, LeavesWhatHasNoExtent) {
  const LatentPlacement placement = standingOnBase(cloudOf({1, 2, 3}, {1}), 5.0);
  EXPECT_EQ(placement.scale, 1.0);
  EXPECT_EQ(placement.offset[2], 0.0);
  EXPECT_EQ(standingOnBase({}, 5.0).scale, 1.0);
}

}  // namespace
}  // namespace stipple
