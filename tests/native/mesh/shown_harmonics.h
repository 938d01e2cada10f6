#pragma once

#include <array>
#include <cstddef>

#include "math/spherical_harmonics.h"

namespace stipple {

/// What coefficients [(degree+1)^2,3] of display values show along a unit direction, degree 3 at
/// most.
inline double shownAlong(const float* coefficients, int degree, const Vec3d& d, size_t channel) {
  std::array<double, 16> basis;
  harmonicBasis(degree, d.x(), d.y(), d.z(), basis.data());
  double value = 0.5;
  for (size_t k = 0; k < static_cast<size_t>((degree + 1) * (degree + 1)); ++k) {
    value += basis[k] * static_cast<double>(coefficients[k * 3 + channel]);
  }
  return value;
}

}  // namespace stipple
