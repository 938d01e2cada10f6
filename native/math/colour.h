#pragma once

#include <cmath>

namespace stipple {

/// IEC 61966-2-1 transfer functions, extended oddly to negative values so that both are bijections
/// of the real line and colours outside 0..1 survive a round trip.
template <typename T>
T srgbToLinear(T value) {
  if (value < T(0)) return -srgbToLinear(-value);
  return value <= T(0.04045) ? value / T(12.92)
                             : std::pow((value + T(0.055)) / T(1.055), T(2.4));
}

template <typename T>
T linearToSrgb(T value) {
  if (value < T(0)) return -linearToSrgb(-value);
  return value <= T(0.0031308) ? value * T(12.92)
                               : T(1.055) * std::pow(value, T(1) / T(2.4)) - T(0.055);
}

}  // namespace stipple
