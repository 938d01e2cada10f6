#include "math/spherical_harmonics.h"

#include <Eigen/LU>
#include <cmath>

// The rotation matrix of a band is D_ij = integral over the sphere of Y_i(d) Y_j(R^-1 d). The
// integrand is a polynomial of degree 2l <= 8 in d, so the product of a 5-point Gauss-Legendre rule
// in z (exact to degree 9) and 12 equal steps in the angle (exact to order 11) gives it exactly.

namespace stipple {

namespace {

constexpr int kMaxDegree = 4;
constexpr double kPi = 3.14159265358979323846;
constexpr int kAngleCount = 12;

struct GaussPoint {
  double z;
  double weight;
};

std::array<GaussPoint, 5> gaussLegendre5() {
  const double r = 2.0 * std::sqrt(10.0 / 7.0);
  const double inner = std::sqrt(5.0 - r) / 3.0;
  const double outer = std::sqrt(5.0 + r) / 3.0;
  const double inner_weight = (322.0 + 13.0 * std::sqrt(70.0)) / 900.0;
  const double outer_weight = (322.0 - 13.0 * std::sqrt(70.0)) / 900.0;
  return {{{-outer, outer_weight},
           {-inner, inner_weight},
           {0.0, 128.0 / 225.0},
           {inner, inner_weight},
           {outer, outer_weight}}};
}

HarmonicTelling makeTelling() {
  HarmonicTelling made = {
      {Vec3d{0.41, 0.91, -0.07}, Vec3d{0.22, 0.27, -0.94}, Vec3d{0.72, 0.24, 0.65},
       Vec3d{-0.06, -0.96, -0.28}, Vec3d{0.65, -0.37, 0.66}, Vec3d{-0.11, 0.66, -0.74},
       Vec3d{0.94, 0.34, 0.08}, Vec3d{0.63, -0.08, -0.77}, Vec3d{-0.92, 0.29, -0.25}},
      {}};
  for (Vec3d& direction : made.directions) direction.normalize();
  for (int l = 1; l <= kMaxDegree; ++l) {
    const int side = 2 * l + 1;
    Eigen::MatrixXd basis(side, side);
    std::array<double, 25> values;
    for (int k = 0; k < side; ++k) {
      const Vec3d& d = made.directions[static_cast<size_t>(k)];
      harmonicBasis(kMaxDegree, d.x(), d.y(), d.z(), values.data());
      for (int j = 0; j < side; ++j) basis(k, j) = values[static_cast<size_t>(l * l + j)];
    }
    const Eigen::MatrixXd inverse = basis.inverse();
    for (int i = 0; i < side; ++i) {
      for (int k = 0; k < side; ++k) {
        made.coefficients[static_cast<size_t>(l)][static_cast<size_t>(i * side + k)] =
            inverse(i, k);
      }
    }
  }
  return made;
}

}  // namespace

HarmonicRotation::HarmonicRotation(const Mat3d& rotation) : bands_{} {
  std::array<double, 25> here;
  std::array<double, 25> turned;
  for (const GaussPoint& point : gaussLegendre5()) {
    const double radius = std::sqrt(1.0 - point.z * point.z);
    for (int k = 0; k < kAngleCount; ++k) {
      const double angle = 2.0 * kPi * k / kAngleCount;
      const Vec3d d(radius * std::cos(angle), radius * std::sin(angle), point.z);
      const Vec3d back = rotation.transpose() * d;
      harmonicBasis(kMaxDegree, d.x(), d.y(), d.z(), here.data());
      harmonicBasis(kMaxDegree, back.x(), back.y(), back.z(), turned.data());
      const double weight = point.weight * 2.0 * kPi / kAngleCount;
      for (int l = 1; l <= kMaxDegree; ++l) {
        const size_t side = static_cast<size_t>(2 * l + 1);
        const size_t first = static_cast<size_t>(l * l);
        for (size_t i = 0; i < side; ++i) {
          for (size_t j = 0; j < side; ++j) {
            bands_[static_cast<size_t>(l)][i * side + j] +=
                weight * here[first + i] * turned[first + j];
          }
        }
      }
    }
  }
}

template <typename T>
void HarmonicRotation::applyTo(int degree, T* coefficients) const {
  for (int l = 1; l <= degree; ++l) {
    const size_t side = static_cast<size_t>(2 * l + 1);
    T* band = coefficients + static_cast<size_t>(l * l) * 3;
    std::array<double, 27> result{};
    for (size_t i = 0; i < side; ++i) {
      for (size_t j = 0; j < side; ++j) {
        const double factor = bands_[static_cast<size_t>(l)][i * side + j];
        for (size_t c = 0; c < 3; ++c) {
          result[i * 3 + c] += factor * static_cast<double>(band[j * 3 + c]);
        }
      }
    }
    for (size_t i = 0; i < side * 3; ++i) band[i] = static_cast<T>(result[i]);
  }
}

void HarmonicRotation::apply(int degree, float* coefficients) const {
  applyTo(degree, coefficients);
}

void HarmonicRotation::apply(int degree, double* coefficients) const {
  applyTo(degree, coefficients);
}

const HarmonicTelling& harmonicTelling() {
  static const HarmonicTelling telling = makeTelling();
  return telling;
}

void rotateHarmonics(const Mat3d& rotation, int degree, float* coefficients) {
  const HarmonicTelling& telling = harmonicTelling();
  const auto direction_count = static_cast<size_t>(2 * degree + 1);
  std::array<std::array<double, 25>, 9> turned;
  for (size_t k = 0; k < direction_count; ++k) {
    const Vec3d back = rotation.transpose() * telling.directions[k];
    harmonicBasis(degree, back.x(), back.y(), back.z(), turned[k].data());
  }
  for (int l = 1; l <= degree; ++l) {
    const auto side = static_cast<size_t>(2 * l + 1), first = static_cast<size_t>(l * l);
    const std::array<double, 81>& inverse = telling.coefficients[static_cast<size_t>(l)];
    float* band = coefficients + first * 3;
    std::array<double, 27> values{};
    for (size_t k = 0; k < side; ++k) {
      for (size_t j = 0; j < side; ++j) {
        for (size_t c = 0; c < 3; ++c) {
          values[k * 3 + c] += turned[k][first + j] * static_cast<double>(band[j * 3 + c]);
        }
      }
    }
    for (size_t i = 0; i < side; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (size_t k = 0; k < side; ++k) sum += inverse[i * side + k] * values[k * 3 + c];
        band[i * 3 + c] = static_cast<float>(sum);
      }
    }
  }
}

}  // namespace stipple
