#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stipple {

/// The nearest whole number 0..last; values outside are moved to the end of the range. In: not NaN.
/// A conversion cuts off, so that adding a half rounds: a call of nearbyint takes ten times as
/// long.
inline uint32_t nearestStep(double value, uint32_t last) {
  return static_cast<uint32_t>(std::clamp(value, 0.0, static_cast<double>(last)) + 0.5);
}
inline uint8_t nearestByte(double value) {
  return static_cast<uint8_t>(nearestStep(value, 255));
}

/// A unit quaternion up to float32 rounding stays as it is, another is normalised in double; zeros
/// become the identity, as 3DGS has it. In and out: w,x,y,z.
inline void normaliseRotation(float* q) {
  double squared = 0;
  for (int k = 0; k < 4; ++k) squared += static_cast<double>(q[k]) * static_cast<double>(q[k]);
  if (std::abs(squared - 1.0) < 1e-6) return;
  if (squared == 0.0) {
    q[0] = 1.0f;
    return;
  }
  const double inverse = 1.0 / std::sqrt(squared);
  for (int k = 0; k < 4; ++k) q[k] = static_cast<float>(static_cast<double>(q[k]) * inverse);
}

}  // namespace stipple
