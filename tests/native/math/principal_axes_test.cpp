#include "math/principal_axes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <random>

namespace stipple {
namespace {

Mat3d randomMatrix(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Mat3d matrix;
  for (Eigen::Index i = 0; i < 9; ++i) matrix.data()[i] = normal(random);
  return matrix;
}

Mat3d product(const PrincipalAxes& axes) {
  return axes.axes * axes.lengths.asDiagonal() * axes.turn.transpose();
}

TEST(PrincipalAxes, GivesTheMatrixBackAndARightHandedFrame) {
  std::mt19937 random(4);
  for (int i = 0; i < 200; ++i) {
    const Mat3d matrix = randomMatrix(random);
    const PrincipalAxes found = principalAxes(matrix);
    // A few sweeps of double arithmetic on values of about 1.
    EXPECT_LT((product(found) - matrix).norm(), 1e-14);
    EXPECT_LT((found.axes.transpose() * found.axes - Mat3d::Identity()).norm(), 1e-14);
    EXPECT_GT(found.axes.determinant(), 0);
    EXPECT_EQ(found.turn.determinant() < 0, matrix.determinant() < 0);
    EXPECT_GE(found.lengths.minCoeff(), 0);
  }
}

TEST(PrincipalAxes, KeepsOrthogonalColumnsInTheirPlaces) {
  const Mat3d turn = Eigen::AngleAxisd(0.7, Vec3d(1, 2, -3).normalized()).toRotationMatrix();
  for (const Vec3d& lengths : {Vec3d(1, 2, 3), Vec3d(3, 1e-6, 20), Vec3d(2, 2, 1)}) {
    const PrincipalAxes found = principalAxes(turn * lengths.asDiagonal());
    EXPECT_LT((found.lengths - lengths).cwiseQuotient(lengths).norm(), 1e-14);
    EXPECT_LT((found.axes - turn).norm(), 1e-14);
  }
}

TEST(PrincipalAxes, FindsSmallLengthsAsExactlyAsLargeOnes) {
  // Graded columns: the eigenvalues of the covariance would be 1e-24 of the largest, far below its
  // rounding. The product of the lengths is the determinant, which is known.
  Mat3d matrix;
  matrix << 1, 1e-6, 3e-12,  //
      1, -2e-6, 1e-12,       //
      0, 1e-6, 5e-12;
  const PrincipalAxes found = principalAxes(matrix);
  const double determinant = 1 * (-2e-6 * 5e-12 - 1e-12 * 1e-6) - 1 * (1e-6 * 5e-12 - 3e-12 * 1e-6);
  EXPECT_NEAR(found.lengths.prod() / std::abs(determinant), 1, 1e-13);
}

TEST(PrincipalAxes, CompletesTheFrameOfFlatNeedlesAndPoints) {
  Mat3d flat = Mat3d::Identity();
  flat(1, 1) = 0;
  Mat3d needle = Mat3d::Zero();
  needle.col(2) = Vec3d(3, 4, 0);
  for (const Mat3d& matrix : {flat, needle, Mat3d(Mat3d::Zero())}) {
    const PrincipalAxes found = principalAxes(matrix);
    EXPECT_LT((product(found) - matrix).norm(), 1e-15);
    EXPECT_LT((found.axes.transpose() * found.axes - Mat3d::Identity()).norm(), 1e-14);
    EXPECT_GT(found.axes.determinant(), 0);
  }
  EXPECT_EQ(principalAxes(needle).lengths, Vec3d(0, 0, 5));
}

TEST(PrincipalAxes, NearestOrthogonalIsThePolarFactor) {
  std::mt19937 random(9);
  for (int i = 0; i < 50; ++i) {
    const Mat3d matrix = randomMatrix(random);
    const Mat3d orthogonal = nearestOrthogonal(matrix);
    const Mat3d stretch = orthogonal.transpose() * matrix;
    EXPECT_LT((orthogonal * orthogonal.transpose() - Mat3d::Identity()).norm(), 1e-14);
    // The other factor is symmetric and has no negative direction.
    EXPECT_LT((stretch - stretch.transpose()).norm(), 1e-13);
    EXPECT_GT(stretch.diagonal().minCoeff(), 0);
  }
}

}  // namespace
}  // namespace stipple
