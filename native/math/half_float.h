#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace stipple {

/// The value of an IEEE 754 binary16 number.
inline float halfToFloat(uint16_t half) {
  const int exponent = (half >> 10) & 31;
  const int mantissa = half & 1023;
  const float sign = (half & 0x8000) != 0 ? -1.0f : 1.0f;
  if (exponent == 31) {
    return mantissa == 0 ? sign * std::numeric_limits<float>::infinity()
                         : std::numeric_limits<float>::quiet_NaN();
  }
  if (exponent == 0) return sign * std::ldexp(static_cast<float>(mantissa), -24);
  return sign * std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
}

/// The nearest binary16 number, of two equally near ones the even one; infinite beyond 65,504.
inline uint16_t floatToHalf(float value) {
  const uint16_t sign = std::signbit(value) ? 0x8000 : 0;
  const float size = std::abs(value);
  if (std::isnan(value)) return sign | 0x7e00;
  if (size >= 65520.0f) return sign | 0x7c00;
  // Numbers below 2^-14 are multiples of 2^-24, as those of the octave above it are.
  const int exponent = size < 0x1p-14f ? -14 : std::ilogb(size);
  const auto steps = static_cast<uint16_t>(std::nearbyint(std::ldexp(size, 10 - exponent)));
  // Rounding up to the next octave carries into the exponent.
  return sign | static_cast<uint16_t>(((exponent + 14) << 10) + steps);
}

}  // namespace stipple
