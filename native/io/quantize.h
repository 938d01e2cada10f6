#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stipple {

/// The nearest whole number 0..255; values outside are moved to the end of the range. In: not NaN.
inline uint8_t nearestByte(double value) {
  return static_cast<uint8_t>(std::clamp(std::nearbyint(value), 0.0, 255.0));
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
