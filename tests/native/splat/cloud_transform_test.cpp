#include "splat/cloud_transform.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
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

TEST(CloudTransform, MovesCovariancesWithTheObject) {
  CloudRecipe recipe;
  recipe.count = 100;
  const SplatCloud cloud = randomCloud(recipe, 2);
  const Mat4d matrix = similarity(2.5, 0.9, {1, 2, 3});
  const SplatCloud moved = transformed(cloud, matrix);
  const Mat3d m = matrix.topLeftCorner<3, 3>();
  for (size_t i = 0; i < cloud.size(); ++i) {
    const Mat3d expected =
        m * covariance<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]) * m.transpose();
    const Mat3d seen = covariance<double>(&moved.rotations[i * 4], &moved.scales[i * 3]);
    // Rotation and scale are rounded to float32.
    EXPECT_LT((seen - expected).norm(), 1e-6 * expected.norm());
  }
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
  withThreads(1, [&] { one = transformed(cloud, similarity(3, 1, {1, 0, 0})); });
  withThreads(2, [&] { two = transformed(cloud, similarity(3, 1, {1, 0, 0})); });
  EXPECT_EQ(one.sh, two.sh);
  EXPECT_EQ(one.rotations, two.rotations);
}

TEST(CloudTransform, RefusesMirrorsShearsUnevenScalesAndOverflow) {
  const SplatCloud cloud = testing::oneSplat(1, 1);
  Mat4d mirror = Mat4d::Identity();
  mirror(0, 0) = -1;
  Mat4d uneven = Mat4d::Identity();
  uneven(1, 1) = 1.001;
  Mat4d shear = Mat4d::Identity();
  shear(0, 1) = 0.001;
  Mat4d singular = Mat4d::Identity();
  singular(2, 2) = 0;
  for (const Mat4d& matrix : {mirror, uneven, shear, singular}) {
    EXPECT_THROW(transformed(cloud, matrix), Error);
  }
  SplatCloud far = cloud;
  far.positions[0] = 3e38f;
  EXPECT_THROW(transformed(far, similarity(10, 0, {0, 0, 0})), Error);
  Mat4d nearly = Mat4d::Identity();
  nearly(1, 1) = 1.00001;
  EXPECT_NO_THROW(transformed(cloud, nearly));
  EXPECT_EQ(transformed(SplatCloud{}, Mat4d::Identity()).size(), 0u);
}

}  // namespace
}  // namespace stipple
