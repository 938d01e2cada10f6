#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "motion/time_window.h"

namespace stipple {

/// Harmonics of a path over the clip.
constexpr size_t kMotionHarmonics = 4;
/// Columns of their coefficients: cosine and sine of each.
constexpr size_t kMotionWaves = 2 * kMotionHarmonics;

/// Bounds of the temporal scale, in stretched time: below, a splat is there in its own moment
/// alone; above is the cap of the released code.
constexpr double kSmallestLifespan = 1e-6;
constexpr double kLargestLifespan = 1.1;

/// Below this length a quaternion has no direction.
constexpr double kNoRotation = 1e-12;

/// One splat that moves: its place is a Fourier series of time, its rotation turns at a constant
/// speed of its quaternion, and it fades in and out on either side of its own moment.
template <typename T>
struct MovingSplat {
  std::array<T, 3> position{};
  std::array<T, 4> rotation = {T(1), T(0), T(0), T(0)};  ///< w,x,y,z, of any length but 0
  T opacity = T(1);                                      ///< at its own moment, 0..1
  std::array<std::array<T, 3>, kMotionWaves> waves{};    ///< cosine 1, sine 1, cosine 2, ...
  std::array<T, kMotionHarmonics> phases{};              ///< radians
  std::array<T, 4> spin{};                               ///< of the quaternion, per stretched time
  std::array<T, 2> lifespans = {T(1), T(1)};  ///< before and after, within the bounds above
  T centre = T(0);                            ///< its moment, as a part of the clip
};

/// Such a splat at a time.
template <typename T>
struct SplatMoment {
  std::array<T, 3> position{};
  std::array<T, 4> rotation{};  ///< unit
  T opacity = T(0);
};

/// The share of the opacity that is left at a stretched offset.
template <typename T>
T temporalShare(const std::array<T, 2>& lifespans, T offset) {
  const T ratio = offset / lifespans[offset < T(0) ? 0 : 1];
  return std::exp(-ratio * ratio);
}

/// Cosine and sine of harmonic k = 1.. at an offset. Whole turns are taken off before, so that
/// float32 keeps its digits whatever the phase.
template <typename T>
std::array<T, 2> harmonicWave(size_t k, T offset, T phase) {
  constexpr T kTurn = T(2 * std::numbers::pi);
  T turns = T(k) * offset + phase / kTurn;
  turns -= std::round(turns);
  return {std::cos(kTurn * turns), std::sin(kTurn * turns)};
}

/// The quaternion at an offset, before it is made unit; the one at rest where it has no direction.
template <typename T>
std::array<T, 4> turnedRotation(const MovingSplat<T>& splat, T offset, T& length) {
  std::array<T, 4> turned;
  T squared = 0;
  for (size_t i = 0; i < 4; ++i) {
    turned[i] = splat.rotation[i] + offset * splat.spin[i];
    squared += turned[i] * turned[i];
  }
  length = std::sqrt(squared);
  if (length >= T(kNoRotation)) return turned;
  squared = 0;
  for (const T value : splat.rotation) squared += value * value;
  length = std::sqrt(squared);
  return splat.rotation;
}

/// The splat at a time.
template <typename T>
SplatMoment<T> momentOf(const MovingSplat<T>& splat, const TimeWindow& window, T time) {
  const T offset = stretchedOffset(window, time, splat.centre);
  SplatMoment<T> moment;
  moment.position = splat.position;
  for (size_t k = 1; k <= kMotionHarmonics; ++k) {
    const auto [cosine, sine] = harmonicWave(k, offset, splat.phases[k - 1]);
    for (size_t axis = 0; axis < 3; ++axis) {
      moment.position[axis] +=
          splat.waves[2 * k - 2][axis] * cosine + splat.waves[2 * k - 1][axis] * sine;
    }
  }
  T length;
  const std::array<T, 4> turned = turnedRotation(splat, offset, length);
  for (size_t i = 0; i < 4; ++i) moment.rotation[i] = turned[i] / length;
  moment.opacity = splat.opacity * temporalShare(splat.lifespans, offset);
  return moment;
}

/// Derivatives of a number by what a moving splat has, from those by its moment. The centre and the
/// offset have none: the centre is never learned.
template <typename T>
MovingSplat<T> momentGradient(const MovingSplat<T>& splat, const TimeWindow& window, T time,
                              const SplatMoment<T>& by_moment) {
  const T offset = stretchedOffset(window, time, splat.centre);
  MovingSplat<T> by;
  by.position = by_moment.position;
  for (size_t k = 1; k <= kMotionHarmonics; ++k) {
    const auto [cosine, sine] = harmonicWave(k, offset, splat.phases[k - 1]);
    T by_phase = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const T g = by_moment.position[axis];
      by.waves[2 * k - 2][axis] = g * cosine;
      by.waves[2 * k - 1][axis] = g * sine;
      by_phase += g * (splat.waves[2 * k - 1][axis] * cosine - splat.waves[2 * k - 2][axis] * sine);
    }
    by.phases[k - 1] = by_phase;
  }
  T length;
  const std::array<T, 4> turned = turnedRotation(splat, offset, length);
  T along = 0;
  for (size_t i = 0; i < 4; ++i) along += turned[i] / length * by_moment.rotation[i];
  for (size_t i = 0; i < 4; ++i) {
    by.rotation[i] = (by_moment.rotation[i] - turned[i] / length * along) / length;
    by.spin[i] = offset * by.rotation[i];
  }
  const T share = temporalShare(splat.lifespans, offset);
  by.opacity = by_moment.opacity * share;
  const size_t side = offset < T(0) ? 0 : 1;
  const T ratio = offset / splat.lifespans[side];
  by.lifespans = {T(0), T(0)};
  by.lifespans[side] =
      by_moment.opacity * splat.opacity * share * T(2) * ratio * ratio / splat.lifespans[side];
  by.centre = T(0);
  return by;
}

}  // namespace stipple
