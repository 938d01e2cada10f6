#pragma once

#include "splat/render/scene.h"

// splatColour of splat/render/scene.h backwards.

namespace stipple {

/// Derivative of srgbToLinear at a value >= 0.
inline double srgbToLinearSlope(double value) {
  return value <= 0.04045 ? 1.0 / 12.92 : 2.4 / 1.055 * std::pow((value + 0.055) / 1.055, 1.4);
}

/// dL/d(sum of the harmonics + 0.5). Where a colour is held at 0 nothing passes.
/// In: sums [3], by_colour [3]. Out: by_sum [3].
inline void colourSumsBackward(const PlacedCloud& placed, const double* sums,
                               const float* by_colour, double* by_sum) {
  double graded[3] = {sums[0], sums[1], sums[2]};
  if (placed.grades_colour) applyGrade(placed.grade, graded);
  for (size_t c = 0; c < 3; ++c) {
    const double by = static_cast<double>(by_colour[c]);
    const bool passes = graded[c] > 0.0 && graded[c] < 1e12;
    by_sum[c] = !passes ? 0.0 : placed.linearise ? by * srgbToLinearSlope(graded[c]) : by;
  }
  if (!placed.grades_colour) return;
  // The grade's matrix, transposed; entries of up to 1e9 could take a product out of float32.
  constexpr double kLargest = 1e37;
  const double by[3] = {by_sum[0], by_sum[1], by_sum[2]};
  for (size_t c = 0; c < 3; ++c) {
    const double sum = placed.grade.matrix[c] * by[0] + placed.grade.matrix[3 + c] * by[1] +
                       placed.grade.matrix[6 + c] * by[2];
    by_sum[c] = std::clamp(sum, -kLargest, kLargest);
  }
}

}  // namespace stipple
