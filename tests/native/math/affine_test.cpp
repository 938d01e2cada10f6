#include "math/affine.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.h"
#include "math/quaternion.h"

namespace stipple {
namespace {

TEST(Affine, AcceptsWhatPlacesAnObject) {
  Mat4d matrix = Mat4d::Identity();
  matrix(0, 0) = 1e-6;
  matrix(1, 1) = -1e6;
  matrix(0, 3) = 1e9;
  EXPECT_NO_THROW(validateAffine(matrix, "matrix"));
}

TEST(Affine, RefusesWhatDoesNot) {
  Mat4d zero = Mat4d::Identity();
  zero.col(1).setZero();
  Mat4d flat = Mat4d::Identity();
  flat.row(2) = flat.row(1);
  Mat4d projective = Mat4d::Identity();
  projective(3, 2) = 1;
  Mat4d nan = Mat4d::Identity();
  nan(1, 2) = NAN;
  Mat4d huge = Mat4d::Identity();
  huge(1, 2) = 1e200;
  for (const Mat4d& matrix : {zero, flat, projective, nan, huge}) {
    EXPECT_THROW(validateAffine(matrix, "matrix"), Error);
  }
}

TEST(Quaternion, GivesTheRotationForAnyLength) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.3, -0.2, 0.9, 0.1).normalized();
  for (const double length : {1e-30, 0.5, 1.0, 1e30}) {
    const float wxyz[4] = {static_cast<float>(q.w() * length), static_cast<float>(q.x() * length),
                           static_cast<float>(q.y() * length), static_cast<float>(q.z() * length)};
    EXPECT_LT((rotationFromQuaternion<double>(wxyz) - q.toRotationMatrix()).norm(), 1e-6);
    EXPECT_LT((rotationFromQuaternion<float>(wxyz).cast<double>() - q.toRotationMatrix()).norm(),
              1e-6);
  }
}

TEST(Quaternion, ComesBackFromItsMatrix) {
  for (const double angle : {0.0, 0.4, 3.0, 3.14159265358979, 5.0}) {
    const Mat3d rotation =
        Eigen::AngleAxisd(angle, Vec3d(1, -2, 0.5).normalized()).toRotationMatrix();
    const Vec4d q = quaternionFromRotation(rotation);
    EXPECT_GE(q[0], 0);
    EXPECT_LT((rotationFromQuaternion<double>(q.data()) - rotation).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace stipple
