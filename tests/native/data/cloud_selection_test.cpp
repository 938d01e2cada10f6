#include "data/clouds/cloud_selection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

TEST(CloudSelection, BoxHoldsItsFacesAndNothingBeyond) {
  SplatCloud cloud = testing::oneSplat(1, 1);
  cloud.resize(4);
  cloud.positions = {1, -1, 1, 1.0001f, 0, 0, 0, 0, 0, 0, 0, -1.0001f};
  for (size_t i = 0; i < 4; ++i) cloud.rotations[i * 4] = 1;
  EXPECT_EQ(insideBox(cloud, Mat4d::Identity()), (std::vector<uint8_t>{1, 0, 1, 0}));
}

TEST(CloudSelection, TurnedBoxSelectsByDistancesAlongItsAxes) {
  CloudRecipe recipe;
  recipe.count = 5000;
  const SplatCloud cloud = randomCloud(recipe, 3);
  Eigen::Affine3d box = Eigen::Translation3d(0.2, -0.1, 0.3) *
                        Eigen::AngleAxisd(0.8, Vec3d(1, 1, 0).normalized()) *
                        Eigen::Scaling(0.5, 0.2, 0.9);
  const Mat4d cloud_to_box = box.inverse().matrix();
  const std::vector<uint8_t> mask = insideBox(cloud, cloud_to_box);
  size_t inside = 0;
  for (size_t i = 0; i < cloud.size(); ++i) {
    const Vec3d d =
        Vec3d(cloud.positions[i * 3], cloud.positions[i * 3 + 1], cloud.positions[i * 3 + 2]) -
        box.translation();
    bool expected = true;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d half = box.linear().col(axis);
      expected &= std::abs(d.dot(half.normalized())) <= half.norm();
    }
    EXPECT_EQ(mask[i] == 1, expected) << i;
    inside += mask[i];
  }
  EXPECT_GT(inside, 100u);
}

TEST(CloudSelection, KeepsRowsBitForBitInTheirOrder) {
  CloudRecipe recipe;
  recipe.count = 9;
  recipe.degree = 2;
  recipe.antialias = Antialias::kMip;
  recipe.colour_space = ColourSpace::kLinear;
  SplatCloud cloud = randomCloud(recipe, 1);
  cloud.frame = Frame::kRUB;
  const std::vector<uint8_t> mask = {0, 1, 0, 0, 1, 255, 0, 0, 1};
  const SplatCloud left = kept(cloud, mask);
  ASSERT_EQ(left.size(), 4u);
  EXPECT_EQ(left.antialias, cloud.antialias);
  EXPECT_EQ(left.colour_space, cloud.colour_space);
  EXPECT_EQ(left.frame, Frame::kRUB);
  const size_t rows[] = {1, 4, 5, 8};
  const size_t stride = cloud.shStride();
  ASSERT_EQ(left.sh.size(), 4 * stride);
  for (size_t k = 0; k < 4; ++k) {
    const size_t i = rows[k];
    EXPECT_EQ(left.opacities[k], cloud.opacities[i]);
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(left.positions[k * 3 + c], cloud.positions[i * 3 + c]);
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(left.scales[k * 3 + c], cloud.scales[i * 3 + c]);
    for (size_t c = 0; c < 4; ++c) EXPECT_EQ(left.rotations[k * 4 + c], cloud.rotations[i * 4 + c]);
    for (size_t c = 0; c < stride; ++c)
      EXPECT_EQ(left.sh[k * stride + c], cloud.sh[i * stride + c]);
  }
}

TEST(CloudSelection, TakesNoneAndAll) {
  const SplatCloud cloud = randomCloud({}, 1);
  EXPECT_EQ(kept(cloud, std::vector<uint8_t>(cloud.size(), 0)).size(), 0u);
  EXPECT_EQ(kept(cloud, std::vector<uint8_t>(cloud.size(), 1)).sh, cloud.sh);
  EXPECT_TRUE(insideBox(SplatCloud{}, Mat4d::Identity()).empty());
}

TEST(CloudSelection, RefusesMasksOfAnotherLengthAndSingularBoxes) {
  const SplatCloud cloud = randomCloud({}, 1);
  EXPECT_THROW(kept(cloud, std::vector<uint8_t>(cloud.size() - 1, 1)), Error);
  Mat4d flat = Mat4d::Identity();
  flat(1, 1) = 0;
  EXPECT_THROW(insideBox(cloud, flat), Error);
}

TEST(CloudSelection, SameForAnyNumberOfThreads) {
  CloudRecipe recipe;
  recipe.count = 40000;
  const SplatCloud cloud = randomCloud(recipe, 7);
  Mat4d half = Mat4d::Identity();
  half(0, 0) = 2;
  std::vector<uint8_t> one, two;
  SplatCloud few, many;
  withThreads(1, [&] { few = kept(cloud, one = insideBox(cloud, half)); });
  withThreads(2, [&] { many = kept(cloud, two = insideBox(cloud, half)); });
  EXPECT_EQ(one, two);
  EXPECT_EQ(few.positions, many.positions);
}

TEST(CloudThinning, KeepsExactlyTheCountAndNests) {
  std::vector<uint8_t> larger(10'007, 1);
  for (const size_t count : {10'007u, 10'006u, 5000u, 17u, 1u, 0u}) {
    const std::vector<uint8_t> mask = thinningMask(10'007, count, 5);
    EXPECT_EQ(static_cast<size_t>(std::count(mask.begin(), mask.end(), 1)), count);
    for (size_t i = 0; i < mask.size(); ++i) EXPECT_LE(mask[i], larger[i]) << i;
    larger = mask;
  }
  EXPECT_NE(thinningMask(1000, 500, 1), thinningMask(1000, 500, 2));
  EXPECT_THROW(thinningMask(10, 11, 0), Error);
}

TEST(CloudThinning, SpreadsOverTheOrderOfTheFile) {
  // Of each tenth of the indices a tenth stays: 1,000 draws of p = 0.1 differ from 100 by less than
  // six standard deviations of 9.5.
  const std::vector<uint8_t> mask = thinningMask(10'000, 1000, 0);
  for (size_t part = 0; part < 10; ++part) {
    const auto begin = mask.begin() + static_cast<std::ptrdiff_t>(part * 1000);
    EXPECT_NEAR(static_cast<double>(std::count(begin, begin + 1000, 1)), 100.0, 57.0);
  }
}

TEST(CloudThinning, WidensWhatStaysSoThatTheVolumeStays) {
  CloudRecipe recipe;
  recipe.count = 400;
  const SplatCloud cloud = randomCloud(recipe, 2);
  const SplatCloud eighth = thinned(cloud, 50, 9);
  const SplatCloud plain = kept(cloud, thinningMask(400, 50, 9));
  EXPECT_EQ(eighth.positions, plain.positions);
  EXPECT_EQ(eighth.opacities, plain.opacities);
  EXPECT_EQ(eighth.sh, plain.sh);
  for (size_t i = 0; i < plain.scales.size(); ++i) {
    EXPECT_EQ(eighth.scales[i], plain.scales[i] * 2.0f) << i;
  }
  EXPECT_EQ(thinned(cloud, 400, 9).scales, cloud.scales);
  EXPECT_EQ(thinned(cloud, 0, 9).size(), 0u);
}

}  // namespace
}  // namespace stipple
