#include "data/clouds/cloud_transform.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/covariance.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

Mat4d similarity(double scale, double angle, const Vec3d& move) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      scale * Eigen::AngleAxisd(angle, Vec3d(0.3, -1, 0.7).normalized()).toRotationMatrix();
  matrix.topRightCorner<3, 1>() = move;
  return matrix;
}

/// One of each kind of matrix that splats can be given.
struct Case {
  const char* name;
  Mat4d matrix;
};

std::vector<Case> affineCases() {
  Mat4d mirror = similarity(1.3, 0.8, {0.1, 0, 0.2});
  mirror.topLeftCorner<3, 3>().col(1) *= -1;
  Mat4d uneven = similarity(1, 0.4, {0, 0.1, 0});
  uneven.topLeftCorner<3, 3>() *= Vec3d(0.5, 1.7, 1).asDiagonal();
  Mat4d shear = Mat4d::Identity();
  shear(0, 1) = 0.7;
  shear(2, 0) = -0.3;
  Mat4d mirrored_shear = shear;
  mirrored_shear.topLeftCorner<3, 3>().row(2) *= -2;
  return {{"rotation", similarity(1, 0.9, {0.1, 0.2, 0.3})},
          {"similarity", similarity(2.5, 0.9, {1, 2, 3})},
          {"mirror", mirror},
          {"uneven scale", uneven},
          {"shear", shear},
          {"mirrored shear", mirrored_shear}};
}

TEST(CloudTransform, MovesCovariancesWithTheObject) {
  CloudRecipe recipe;
  recipe.count = 200;
  SplatCloud cloud = randomCloud(recipe, 2);
  // A needle of 1e6, a disc without thickness, a point.
  cloud.scales[0] = 1e-6f;
  cloud.scales[1] = 1;
  cloud.scales[3] = 0;
  for (size_t axis = 0; axis < 3; ++axis) cloud.scales[6 + axis] = 0;
  for (const auto& [name, matrix] : affineCases()) {
    SCOPED_TRACE(name);
    const SplatCloud moved = transformed(cloud, matrix);
    const Mat3d m = matrix.topLeftCorner<3, 3>();
    for (size_t i = 0; i < cloud.size(); ++i) {
      const Mat3d expected =
          m * covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]) * m.transpose();
      const Mat3d seen = covariance<double>(&moved.rotations[i * 4], &moved.scales[i * 3]);
      // Rotation and scale are rounded to float32.
      EXPECT_LE((seen - expected).norm(), 1e-6 * expected.norm());
    }
    EXPECT_NO_THROW(validate(moved, "moved"));
  }
}

TEST(CloudTransform, MakesThePictureThatTheMatrixMakes) {
  CloudRecipe recipe;
  recipe.count = 300;
  recipe.size_min = 0.02;
  for (const auto& [name, matrix] : affineCases()) {
    SCOPED_TRACE(name);
    const Mat3d linear = linearPart(matrix);
    const bool bends = !(linear.transpose() * linear).isDiagonal(1e-9) ||
                       std::abs(linear.col(0).norm() - linear.col(1).norm()) > 1e-9;
    // Uneven matrices bend viewing directions, which harmonics above degree 0 cannot follow.
    recipe.degree = bends ? 0 : 4;
    const SplatCloud cloud = randomCloud(recipe, 21);
    const SplatCloud moved = transformed(cloud, matrix);
    const Camera camera = testing::frontCamera(64, 64, 60, 14);
    SplatInstance placed;
    placed.cloud = &cloud;
    placed.object_to_world = matrix;
    SplatInstance applied;
    applied.cloud = &moved;
    const ReferenceResult through = renderReference(std::span(&placed, 1), camera, {});
    const ReferenceResult stored = renderReference(std::span(&applied, 1), camera, {});
    double largest = 0;
    double coverage = 0;
    for (size_t i = 0; i < through.colour.size(); ++i) {
      largest = std::max(largest, std::abs(through.colour[i] - stored.colour[i]));
      coverage = std::max(coverage, through.colour[i]);
    }
    // Attributes are rounded to float32: 1e-7 of sizes, colours and places in the picture, summed
    // over the splats of a pixel.
    EXPECT_LT(largest, 3e-5);
    EXPECT_GT(coverage, 0.5);
  }
}

TEST(CloudTransform, KeepsAxesAndTheirOrderUnderRotation) {
  CloudRecipe recipe;
  recipe.count = 100;
  const SplatCloud cloud = randomCloud(recipe, 5);
  const SplatCloud moved = transformed(cloud, similarity(1, 2.2, {0, 0, 0}));
  for (size_t i = 0; i < cloud.scales.size(); ++i) {
    // One rounding: the scale of a rotation differs from 1 by 1e-16.
    EXPECT_FLOAT_EQ(moved.scales[i], cloud.scales[i]);
  }
}

TEST(CloudTransform, MirroredTwiceIsTheCloud) {
  CloudRecipe recipe;
  recipe.count = 50;
  recipe.degree = 4;
  const SplatCloud cloud = randomCloud(recipe, 6);
  Mat4d mirror = Mat4d::Identity();
  mirror(0, 0) = -1;
  const SplatCloud once = transformed(cloud, mirror);
  const SplatCloud twice = transformed(once, mirror);
  EXPECT_EQ(twice.positions, cloud.positions);
  EXPECT_EQ(twice.scales, cloud.scales);
  // Of degree 1 (y, z, x), the mirror turns the sign of x alone.
  const size_t stride = cloud.shStride();
  for (size_t i = 0; i < cloud.size(); ++i) {
    const float* before = &cloud.sh[i * stride];
    const float* after = &once.sh[i * stride];
    EXPECT_NEAR(after[3], before[3], 1e-6);
    EXPECT_NEAR(after[6], before[6], 1e-6);
    EXPECT_NEAR(after[9], -before[9], 1e-6);
  }
  for (size_t i = 0; i < cloud.sh.size(); ++i) EXPECT_NEAR(twice.sh[i], cloud.sh[i], 1e-6);
}

TEST(CloudTransform, KeepsTheOrderOfScalesUnderMildShear) {
  SplatCloud cloud = testing::oneSplat(1, 1);
  cloud.scales = {0.1f, 3, 1};
  Mat4d shear = Mat4d::Identity();
  shear(0, 1) = 0.05;
  const SplatCloud moved = transformed(cloud, shear);
  EXPECT_NEAR(moved.scales[0], 0.1, 0.01);
  EXPECT_NEAR(moved.scales[1], 3, 0.01);
  EXPECT_NEAR(moved.scales[2], 1, 1e-6);
}

TEST(CloudTransform, UndoneByItsInverse) {
  CloudRecipe recipe;
  recipe.count = 50;
  recipe.degree = 4;
  const SplatCloud cloud = randomCloud(recipe, 8);
  const SplatCloud moved = transformed(cloud, similarity(0.5, 2.0, {0, 0, 0}));
  const SplatCloud back = transformed(moved, similarity(2.0, -2.0, {0, 0, 0}));
  // Two roundings to float32 of values up to 1.7.
  for (size_t i = 0; i < cloud.sh.size(); ++i) EXPECT_NEAR(back.sh[i], cloud.sh[i], 1e-6);
  for (size_t i = 0; i < cloud.positions.size(); ++i) {
    EXPECT_NEAR(back.positions[i], cloud.positions[i], 1e-6);
  }
}

TEST(CloudTransform, KeepsEveryBitForTheIdentityButTheQuaternionsLength) {
  CloudRecipe recipe;
  recipe.degree = 2;
  const SplatCloud cloud = randomCloud(recipe, 8);
  const SplatCloud same = transformed(cloud, Mat4d::Identity());
  EXPECT_EQ(same.positions, cloud.positions);
  EXPECT_EQ(same.scales, cloud.scales);
  for (size_t i = 0; i < cloud.sh.size(); ++i) EXPECT_NEAR(same.sh[i], cloud.sh[i], 3e-7);
}

TEST(CloudTransform, SameForAnyNumberOfThreads) {
  CloudRecipe recipe;
  recipe.count = 10000;
  recipe.degree = 1;
  const SplatCloud cloud = randomCloud(recipe, 8);
  SplatCloud one, two;
  const Mat4d matrix = affineCases().back().matrix;
  withThreads(1, [&] { one = transformed(cloud, matrix); });
  withThreads(2, [&] { two = transformed(cloud, matrix); });
  EXPECT_EQ(one.sh, two.sh);
  EXPECT_EQ(one.rotations, two.rotations);
}

TEST(CloudTransform, RefusesSingularMatricesAndOverflow) {
  const SplatCloud cloud = testing::oneSplat(1, 1);
  Mat4d singular = Mat4d::Identity();
  singular(2, 2) = 0;
  Mat4d projective = Mat4d::Identity();
  projective(3, 0) = 1;
  Mat4d not_finite = Mat4d::Identity();
  not_finite(0, 3) = std::nan("");
  for (const Mat4d& matrix : {singular, projective, not_finite}) {
    EXPECT_THROW(transformed(cloud, matrix), Error);
  }
  SplatCloud far = cloud;
  far.positions[0] = 3e38f;
  EXPECT_THROW(transformed(far, similarity(10, 0, {0, 0, 0})), Error);
  EXPECT_EQ(transformed(SplatCloud{}, Mat4d::Identity()).size(), 0u);
}

}  // namespace
}  // namespace stipple
