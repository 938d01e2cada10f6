// Toggling, shrinking by the automatic distance, and balls in a frame of their own.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "data/clouds/splat_cloud.h"
#include "splat/edit/region_selection.h"

using namespace stipple;

namespace {

constexpr size_t kCount = 5000;

SplatCloud scatteredCloud() {
  SplatCloud cloud;
  cloud.sh_degree = 0;
  for (size_t i = 0; i < kCount; ++i) {
    for (uint64_t k = 0; k < 3; ++k) {
      cloud.positions.push_back(static_cast<float>(4 * unitDouble(mixBits(7 * kCount + i * 3 + k)) - 2));
    }
    cloud.rotations.insert(cloud.rotations.end(), {1, 0, 0, 0});
    cloud.scales.insert(cloud.scales.end(), {0.1f, 0.1f, 0.1f});
    cloud.opacities.push_back(0.5f);
    for (uint64_t k = 0; k < 3; ++k) {
      cloud.sh.push_back(static_cast<float>(2 * unitDouble(mixBits(~(i * 3 + k))) - 1));
    }
  }
  return cloud;
}

Region ball(double radius, const Mat4d& frame, const Vec3d& centre) {
  Region region;
  region.kind = RegionKind::kSphere;
  region.radius = radius;
  region.cloud_to_box = frame;
  region.centre = centre;
  return region;
}

std::vector<uint8_t> selected(const SplatCloud& cloud, const std::vector<Region>& regions) {
  return selectedByRegions(cloud, regions, std::vector<uint8_t>(cloud.size(), 0));
}

}  // namespace

TEST(RegionFrames, ABallIsRoundInItsOwnFrame) {
  const SplatCloud cloud = scatteredCloud();
  Mat4d frame = Mat4d::Identity();
  frame.topLeftCorner<3, 3>() << 2, 0.5, 0, -0.3, 0.5, 0, 0, 0, 1.5;
  frame.topRightCorner<3, 1>() << 0.3, -0.2, 1;
  const Vec3d centre(0.5, 0.1, 0.8);
  const std::vector<uint8_t> mask = selected(cloud, {ball(1.2, frame, centre)});
  size_t inside = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* p = &cloud.positions[i * 3];
    const Vec3d q(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
    const Vec3d place = frame.topLeftCorner<3, 3>() * q + frame.topRightCorner<3, 1>();
    const bool expected = (place - centre).norm() <= 1.2;
    EXPECT_EQ(mask[i] != 0, expected) << i;
    inside += expected;
  }
  EXPECT_GT(inside, 50u);
  EXPECT_LT(inside, kCount - 50);
}

TEST(RegionFrames, ColoursAreLookedForInTheSameBall) {
  const SplatCloud cloud = scatteredCloud();
  Mat4d frame = Mat4d::Identity();
  frame(0, 0) = 3;
  const Region around = ball(1.5, frame, Vec3d(0.5, 0, 0));
  Region colour = around;
  colour.kind = RegionKind::kColour;
  colour.colour = Vec3d(0.2, 0.2, 0.2);
  colour.tolerance = 0.3;
  Region everywhere = colour;
  everywhere.radius = 0;
  const std::vector<uint8_t> inside = selected(cloud, {around});
  const std::vector<uint8_t> like = selected(cloud, {everywhere});
  const std::vector<uint8_t> both = selected(cloud, {colour});
  size_t count = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(both[i], inside[i] & like[i]);
    count += both[i];
  }
  EXPECT_GT(count, 10u);
}

TEST(RegionFrames, TogglingInvertsWhatTheRegionHolds) {
  const SplatCloud cloud = scatteredCloud();
  const Region one = ball(1.5, Mat4d::Identity(), Vec3d::Zero());
  Region other = ball(1.5, Mat4d::Identity(), Vec3d(1, 0, 0));
  other.operation = RegionOperation::kToggle;
  Region all;
  all.operation = RegionOperation::kToggle;
  const std::vector<uint8_t> a = selected(cloud, {one});
  const std::vector<uint8_t> b = selected(cloud, {other});
  const std::vector<uint8_t> toggled = selected(cloud, {one, other});
  const std::vector<uint8_t> inverted = selected(cloud, {one, all});
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(toggled[i], a[i] ^ b[i]);
    EXPECT_EQ(inverted[i], 1 - a[i]);
  }
}

TEST(RegionFrames, ShrinkingTakesTheDistanceThatGrowingTakes) {
  const SplatCloud cloud = scatteredCloud();
  const Region one = ball(1.5, Mat4d::Identity(), Vec3d::Zero());
  Region shrink;
  shrink.kind = RegionKind::kGrow;
  shrink.shrink = true;
  const std::vector<uint8_t> before = selected(cloud, {one});
  const std::vector<uint8_t> automatic = selected(cloud, {one, shrink});
  size_t left = 0, was = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_LE(automatic[i], before[i]);
    left += automatic[i];
    was += before[i];
  }
  EXPECT_LT(left, was);
  EXPECT_GT(left, 0u);
  shrink.distance = 0.2;
  Region negative = shrink;
  negative.shrink = false;
  negative.distance = -0.2;
  EXPECT_EQ(selected(cloud, {one, shrink}), selected(cloud, {one, negative}));
}

TEST(RegionFrames, AFrameThatCannotBeInvertedIsRefused) {
  const SplatCloud cloud = scatteredCloud();
  EXPECT_THROW(selected(cloud, {ball(1, Mat4d::Zero(), Vec3d::Zero())}), Error);
}
