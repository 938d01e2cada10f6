#include "math/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

namespace stipple {
namespace {

Vec3d direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Vec3d(normal(random), normal(random), normal(random)).normalized();
}

/// Y_lm from the definition: associated Legendre functions with the Condon-Shortley sign, real
/// form.
double harmonicByDefinition(int l, int m, const Vec3d& d) {
  const int a = std::abs(m);
  const double phi = std::atan2(d.y(), d.x());
  double factor = (2 * l + 1) / (4 * M_PI);
  for (int k = l - a + 1; k <= l + a; ++k) factor /= k;
  // std::assoc_legendre leaves the sign (-1)^m out.
  const double sign = a % 2 ? -1.0 : 1.0;
  const double p = sign * std::sqrt(factor) *
                   std::assoc_legendre(static_cast<unsigned>(l), static_cast<unsigned>(a), d.z());
  if (m == 0) return p;
  return std::sqrt(2.0) * p * (m > 0 ? std::cos(a * phi) : std::sin(a * phi));
}

TEST(SphericalHarmonics, AreTheRealHarmonicsOfTheDefinition) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3d d = direction(random);
    double basis[25];
    harmonicBasis(4, d.x(), d.y(), d.z(), basis);
    for (int l = 0; l <= 4; ++l) {
      for (int m = -l; m <= l; ++m) {
        EXPECT_NEAR(basis[l * l + l + m], harmonicByDefinition(l, m, d), 1e-13)
            << "l " << l << " m " << m;
      }
    }
  }
}

TEST(SphericalHarmonics, HaveTheSignsOfSplatFiles) {
  double basis[25];
  harmonicBasis(1, 0.0, 1.0, 0.0, basis);
  EXPECT_NEAR(basis[1], -0.48860251190291992, 1e-15);
  harmonicBasis(1, 0.0, 0.0, 1.0, basis);
  EXPECT_NEAR(basis[2], 0.48860251190291992, 1e-15);
  harmonicBasis(1, 1.0, 0.0, 0.0, basis);
  EXPECT_NEAR(basis[3], -0.48860251190291992, 1e-15);
}

TEST(SphericalHarmonics, RotatedCoefficientsGiveTheRotatedFunction) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 20; ++trial) {
    const Mat3d rotation =
        Eigen::AngleAxisd(normal(random) * 3, direction(random)).toRotationMatrix();
    for (int degree = 1; degree <= 4; ++degree) {
      std::vector<double> original(static_cast<size_t>((degree + 1) * (degree + 1) * 3));
      for (double& value : original) value = normal(random);
      std::vector<double> turned = original;
      HarmonicRotation(rotation).apply(degree, turned.data());
      std::vector<float> turned_float(original.begin(), original.end());
      rotateHarmonics(rotation, degree, turned_float.data());
      const Vec3d d = direction(random);
      const Vec3d moved = rotation * d;
      double before[25], after[25];
      harmonicBasis(degree, d.x(), d.y(), d.z(), before);
      harmonicBasis(degree, moved.x(), moved.y(), moved.z(), after);
      for (size_t c = 0; c < 3; ++c) {
        double expected = 0, seen = 0, seen_float = 0;
        for (size_t k = 0; k < original.size() / 3; ++k) {
          expected += before[k] * original[k * 3 + c];
          seen += after[k] * turned[k * 3 + c];
          seen_float += after[k] * static_cast<double>(turned_float[k * 3 + c]);
        }
        EXPECT_NEAR(seen, expected, 1e-13);
        // 25 float32 coefficients of size 3.
        EXPECT_NEAR(seen_float, expected, 2e-6);
      }
    }
  }
}

TEST(SphericalHarmonics, TurningBackAndForthIsTheIdentity) {
  const Mat3d rotation = Eigen::AngleAxisd(0.7, Vec3d(1, 1, 0).normalized()).toRotationMatrix();
  std::vector<double> values(75);
  for (size_t i = 0; i < values.size(); ++i) values[i] = std::sin(static_cast<double>(i));
  std::vector<double> turned = values;
  HarmonicRotation(rotation).apply(4, turned.data());
  EXPECT_GT(std::abs(turned[10] - values[10]), 1e-3);
  HarmonicRotation(rotation.transpose()).apply(4, turned.data());
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(turned[i], values[i], 1e-13);
}

}  // namespace
}  // namespace stipple
