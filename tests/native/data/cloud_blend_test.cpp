#include "data/clouds/cloud_blend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "math/quaternion.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::oneSplat;
using testing::randomCloud;

SplatCloud cloudOf(size_t count, uint32_t seed, int degree = 2) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = degree;
  return randomCloud(recipe, seed);
}

void expectSame(const SplatCloud& a, const SplatCloud& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.rotations, b.rotations);
  EXPECT_EQ(a.scales, b.scales);
  EXPECT_EQ(a.opacities, b.opacities);
  EXPECT_EQ(a.sh, b.sh);
}

TEST(CloudBlend, AQuarterOfTheWayIsAQuarterOfEveryNumber) {
  SplatCloud from = oneSplat(0.0f, 0.0f, 1.0f), to = oneSplat(0.4f, 1.0f, -1.0f), out;
  to.positions = {4, -8, 12};
  to.rotations = {0, 0, 0, 2};  // half a turn, of length 2
  from.colour_space = ColourSpace::kLinear;
  blendClouds(from, to, 0.25, out);
  EXPECT_EQ(out.positions, (std::vector<float>{1, -2, 3}));
  EXPECT_EQ(out.scales, (std::vector<float>{0.1f, 0.1f, 0.1f}));
  EXPECT_EQ(out.opacities, (std::vector<float>{0.25f}));
  EXPECT_EQ(out.sh, (std::vector<float>{0.5f, 0.5f, 0.5f}));
  // (3, 0, 0, 1) / sqrt(10): lengths count for nothing.
  EXPECT_FLOAT_EQ(out.rotations[0], static_cast<float>(3 / std::sqrt(10.0)));
  EXPECT_FLOAT_EQ(out.rotations[3], static_cast<float>(1 / std::sqrt(10.0)));
  EXPECT_EQ(out.colour_space, ColourSpace::kLinear);
}

TEST(CloudBlend, QuaternionsOfOppositeSignsAreTheSameRotation) {
  const SplatCloud from = cloudOf(500, 1);
  SplatCloud to = from, out;
  for (float& value : to.rotations) value = -value;
  for (const double share : {0.0, 0.3, 0.5, 0.999}) {
    blendClouds(from, to, share, out);
    for (size_t i = 0; i < from.size(); ++i) {
      const Mat3d turned = rotationFromQuaternion<double>(&out.rotations[4 * i]);
      const Mat3d before = rotationFromQuaternion<double>(&from.rotations[4 * i]);
      // A float32 rounding of each component.
      ASSERT_LT((turned - before).cwiseAbs().maxCoeff(), 1e-6) << i << " at " << share;
    }
  }
}

TEST(CloudBlend, RotationsGoTheShorterWayAndStayUnit) {
  const SplatCloud from = cloudOf(2000, 2), to = cloudOf(2000, 3);
  SplatCloud out;
  const auto angle = [](const float* a, const float* b) {
    double dot = 0, aa = 0, bb = 0;
    for (size_t k = 0; k < 4; ++k) {
      const double x = static_cast<double>(a[k]), y = static_cast<double>(b[k]);
      dot += x * y;
      aa += x * x;
      bb += y * y;
    }
    return 2 * std::acos(std::min(1.0, std::abs(dot) / std::sqrt(aa * bb)));
  };
  for (const double share : {0.1, 0.5, 0.8}) {
    blendClouds(from, to, share, out);
    for (size_t i = 0; i < from.size(); ++i) {
      const float* made = &out.rotations[4 * i];
      double square = 0;
      for (size_t k = 0; k < 4; ++k) square += static_cast<double>(made[k] * made[k]);
      ASSERT_NEAR(square, 1, 1e-6);
      // On the great circle between the two: both parts of the way add up to the shorter one.
      // 1e-3: acos near 1 has the root of a float32 rounding.
      const double whole = angle(&from.rotations[4 * i], &to.rotations[4 * i]);
      const double parts = angle(&from.rotations[4 * i], made) + angle(made, &to.rotations[4 * i]);
      ASSERT_NEAR(parts, whole, 1e-3) << i;
      ASSERT_TRUE(share != 0.5 || std::abs(angle(&from.rotations[4 * i], made) - whole / 2) < 1e-3);
    }
  }
}

TEST(CloudBlend, WhatIsTheSameStaysBitForBitAndNothingLeavesWhatLiesBetween) {
  SplatCloud cloud = cloudOf(3000, 4), out;
  // The smallest and largest numbers of float32, and quaternions that are not unit.
  cloud.positions[0] = std::numeric_limits<float>::max();
  cloud.positions[1] = -std::numeric_limits<float>::max();
  cloud.positions[2] = std::numeric_limits<float>::denorm_min();
  cloud.scales[0] = 1e-40f;
  SplatCloud other = cloud;
  for (const double share : {0.0, 1e-9, 0.1, 1.0 / 3, 0.7, 1 - 1e-16, 1.0}) {
    blendClouds(cloud, other, share, out);
    expectSame(out, cloud);
  }
  other = cloudOf(3000, 5);
  other.positions[0] = -std::numeric_limits<float>::max();
  for (const double share : {1e-9, 0.37, 1 - 1e-9}) {
    blendClouds(cloud, other, share, out);
    for (size_t i = 0; i < out.positions.size(); ++i) {
      ASSERT_GE(out.positions[i], std::min(cloud.positions[i], other.positions[i]));
      ASSERT_LE(out.positions[i], std::max(cloud.positions[i], other.positions[i]));
    }
    EXPECT_NO_THROW(validate(out, "between"));
  }
}

TEST(CloudBlend, UsesMemoryAgainAndGivesTheSameForAnyNumberOfThreads) {
  const SplatCloud from = cloudOf(20000, 6), to = cloudOf(20000, 7);
  SplatCloud one, two = cloudOf(20000, 8);
  const float* memory = two.sh.data();
  withThreads(1, [&] { blendClouds(from, to, 0.6, one); });
  withThreads(2, [&] { blendClouds(from, to, 0.6, two); });
  expectSame(one, two);
  EXPECT_EQ(two.sh.data(), memory);
  SplatCloud none;
  blendClouds({}, {}, 0.5, none);
  EXPECT_EQ(none.size(), 0u);
}

TEST(CloudBlend, RefusesCloudsOfOtherSplats) {
  SplatCloud out;
  try {
    blendClouds(cloudOf(3, 1), cloudOf(4, 1), 0.5, out);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(
        error.what(),
        "clouds of 3 splats of degree 2 and of 4 of degree 2 have nothing between them; as "
        "many of one degree are needed");
  }
  EXPECT_THROW(blendClouds(cloudOf(3, 1, 1), cloudOf(3, 1, 2), 0.5, out), Error);
}

}  // namespace
}  // namespace stipple
