#pragma once

#include "math/spherical_harmonics_gradient.h"
#include "splat/scene.h"

// splatColour of splat/scene.h backwards.

namespace stipple {

/// A float32 of any double: held to the largest that is finite.
inline float storedGradient(double value) {
  constexpr double kLargest = 3.4e38;
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

/// Derivative of srgbToLinear at a value >= 0.
inline double srgbToLinearSlope(double value) {
  return value <= 0.04045 ? 1.0 / 12.92 : 2.4 / 1.055 * std::pow((value + 0.055) / 1.055, 1.4);
}

/// In: dL/dcolour [3] of a splat in the blending space. Out: dL/dsh [shStride()] of its cloud.
/// Returns the derivative by the viewing direction before it is made unit, in object space: by the
/// position under a perspective camera. Where a colour is held at 0 nothing passes.
inline Vec3d splatColourBackward(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                                 const double* by_colour, float* by_sh) {
  const SplatCloud& cloud = *placed.cloud;
  const float* sh = &cloud.sh[index * cloud.shStride()];
  double basis[25];
  double slopes[25][3];
  basis[0] = static_cast<double>(kShC0);
  Vec3d direction = placed.eye;
  double length = 1.0;
  if (placed.sh_degree > 0) {
    if (scene.view.perspective) {
      const float* position = &cloud.positions[index * 3];
      direction = Vec3d(static_cast<double>(position[0]), static_cast<double>(position[1]),
                        static_cast<double>(position[2])) -
                  placed.eye;
    }
    length = direction.norm();
    direction /= length;
    harmonicBasis(placed.sh_degree, direction[0], direction[1], direction[2], basis);
    harmonicBasisGradient(placed.sh_degree, direction[0], direction[1], direction[2], slopes);
  }
  const size_t count = shCoefficientCount(placed.sh_degree);
  double by_basis[25] = {};
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0.5;
    for (size_t k = 0; k < count; ++k) sum += basis[k] * static_cast<double>(sh[k * 3 + c]);
    if (!(sum > 0.0 && sum < 1e12)) continue;
    const double by_sum = by_colour[c] * (placed.linearise ? srgbToLinearSlope(sum) : 1.0);
    for (size_t k = 0; k < count; ++k) by_sh[k * 3 + c] = storedGradient(by_sum * basis[k]);
    for (size_t k = 1; k < count; ++k) by_basis[k] += by_sum * static_cast<double>(sh[k * 3 + c]);
  }
  Vec3d by_direction = Vec3d::Zero();
  for (size_t k = 1; k < count; ++k) {
    by_direction += by_basis[k] * Vec3d(slopes[k][0], slopes[k][1], slopes[k][2]);
  }
  by_direction -= direction * direction.dot(by_direction);
  return by_direction / length;
}

}  // namespace stipple
