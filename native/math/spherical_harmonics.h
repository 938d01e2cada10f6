#pragma once

#include <array>

#include "math/vec.h"

namespace stipple {

#include "math/harmonic_basis-inl.h"

/// Turns coefficients so that the function turns with the object: f'(R d) = f(d). Made once per
/// rotation, applied to every splat; exact up to rounding.
class HarmonicRotation {
 public:
  /// In: an orthogonal matrix: a rotation, or one that mirrors (then f'(R d) = f(d) as well).
  explicit HarmonicRotation(const Mat3d& rotation);
  /// In and out: coefficients [(degree+1)^2,3], degree 0..4.
  void apply(int degree, float* coefficients) const;
  void apply(int degree, double* coefficients) const;

 private:
  template <typename T>
  void applyTo(int degree, T* coefficients) const;

  /// One (2l+1)x(2l+1) matrix per degree 1..4, row-major.
  std::array<std::array<double, 81>, 5> bands_;
};

/// Directions in which the values of a function tell its coefficients.
struct HarmonicTelling {
  /// Unit. The first 2l + 1 tell the coefficients of degree l apart: their matrices of basis
  /// functions have condition numbers of 3.
  std::array<Vec3d, 9> directions;
  /// For degree l, what gives coefficients from values in the first 2l + 1 of these directions.
  /// [2l+1,2l+1], row-major
  std::array<std::array<double, 81>, 5> coefficients;
};
const HarmonicTelling& harmonicTelling();

/// HarmonicRotation for one set of coefficients [(degree+1)^2,3], in a tenth of the time that
/// making one takes: the turned function's values in as many directions as there are coefficients.
void rotateHarmonics(const Mat3d& rotation, int degree, float* coefficients);

}  // namespace stipple
