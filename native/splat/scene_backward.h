#pragma once

#include "splat/scene.h"

// splatColour of splat/scene.h backwards.

namespace stipple {

/// Derivative of srgbToLinear at a value >= 0.
inline double srgbToLinearSlope(double value) {
  return value <= 0.04045 ? 1.0 / 12.92 : 2.4 / 1.055 * std::pow((value + 0.055) / 1.055, 1.4);
}

/// dL/d(sum of the harmonics + 0.5) of one channel. Where a colour is held at 0 nothing passes.
inline double colourSumBackward(const PlacedCloud& placed, double sum, double by_colour) {
  if (!(sum > 0.0 && sum < 1e12)) return 0.0;
  return placed.linearise ? by_colour * srgbToLinearSlope(sum) : by_colour;
}

}  // namespace stipple
