#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "motion/moving_splat.h"

namespace stipple {

/// Frames that a new splat is visible for, and the share of its opacity that counts as visible.
constexpr double kVisibleFrames = 50;
constexpr double kVisibleShare = 0.2;

/// The temporal scale of a raw value of 0: at it a splat keeps kVisibleShare of its opacity over
/// kVisibleFrames frames of time that is not stretched. Clips of one frame count as two.
inline double lifespanUnit(uint32_t frame_count) {
  const double frames = std::max<double>(frame_count, 2);
  return (kVisibleFrames - 1) / 2 / (frames - 1) / std::sqrt(-std::log(kVisibleShare));
}

/// The temporal scale of a raw value, within its bounds.
template <typename T>
T lifespanOf(T raw, double unit) {
  // Beyond this the bounds decide; exp would overflow.
  const T limited = std::clamp(raw, T(-40), T(40));
  return std::clamp(T(unit) * std::exp(limited), T(kSmallestLifespan), T(kLargestLifespan));
}

/// Derivative by the raw value from that by the temporal scale. At a bound, what would bring the
/// scale back by gradient descent passes and the rest does not: with none at all, a scale that has
/// reached its cap would stay there.
template <typename T>
T rawLifespanGradient(T raw, double unit, T by_lifespan) {
  const T free = T(unit) * std::exp(std::clamp(raw, T(-40), T(40)));
  if (free > T(kLargestLifespan)) return std::max(by_lifespan, T(0)) * T(kLargestLifespan);
  if (free < T(kSmallestLifespan)) return std::min(by_lifespan, T(0)) * T(kSmallestLifespan);
  return by_lifespan * free;
}

}  // namespace stipple
