#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "splat/blend.h"

// One pixel of splat/blend.h backwards, from its last splat to its first. With B the colour behind
// a splat, the background included, and T the transmittance before it,
//   dL/dalpha = T (c - B).dL/dC,   dL/dc = T alpha dL/dC,   B <- alpha c + (1 - alpha) B,
// and without the splat the pixel would change by exactly dC = T alpha (c - B). B is a convex
// combination, so no step loses digits. T is recovered by dividing by 1 - alpha >= 0.01.
// Based on: Kerbl et al., 3D Gaussian Splatting, SIGGRAPH 2023, section 6; Yan et al., Generative
// 3D Gaussians with Learned Density Control, SIGGRAPH 2026 (the contribution). Differs: B holds the
// background, so the contribution is exact over any background.

namespace stipple {

/// What is computed beside the gradients.
enum class BackwardMode : uint32_t {
  kGradients = 0,
  kContributions = 1,  ///< and leave-one-out contributions
  kStatistics = 2,     ///< and every other statistic
};

/// Sums over pixels that one splat has, in this order. With g the offset from the centre such that
/// alpha = o 2^(-|g|^2), and s = alpha dL/dalpha where alpha is not held at 0.99.
enum BackwardField : size_t {
  kFieldS = 0,  ///< sum of s
  kFieldG0,     ///< sum of s g0
  kFieldG1,
  kFieldG00,  ///< sum of s g0 g0
  kFieldG01,
  kFieldG11,
  kFieldRed,  ///< dL/dcolour
  kFieldGreen,
  kFieldBlue,
  kGradientFieldCount,
  kFieldContribution = kGradientFieldCount,
  kContributionFieldCount,
  kFieldWeight = kContributionFieldCount,
  kFieldEdge,
  kFieldAbsoluteX,  ///< sum of |dL/d centre x| of one pixel, pixels
  kFieldAbsoluteY,
  kFieldNorm,
  kFieldError,
  kFieldLargestError,  ///< a maximum, not a sum
  kStatisticsFieldCount,
};

constexpr size_t backwardFieldCount(BackwardMode mode) {
  return mode == BackwardMode::kGradients       ? kGradientFieldCount
         : mode == BackwardMode::kContributions ? kContributionFieldCount
                                                : kStatisticsFieldCount;
}

/// 2 ln 2: q = d^T C^-1 d is this times |g|^2.
constexpr double kSquaredGScale = 1.3862943611198906;

/// A splat at one pixel.
template <typename T>
struct SplatAtPixel {
  T alpha;    ///< > 0
  bool held;  ///< alpha is held at 0.99
  T g0, g1;
  T l00, l10, l11;  ///< g = l d, d in pixels
  T colour[3];
};

/// The loss at one pixel. With R the residual and w its weight: signed_weight = w sign(R), room =
/// 2 w |R|.
template <typename T>
struct PixelLoss {
  T gradient[4];  ///< dL/d(red, green, blue, alpha)
  T signed_weight[3];
  T room[3];
  T edge;
  T error;
};

/// One pixel while splats are taken off it, last first.
template <typename T>
struct PixelBackward {
  T transmittance;     ///< before the splat that was taken off last
  T behind;            ///< (colour behind).dL/dC
  T colour_behind[3];  ///< kept for contributions only
};

/// w (|R| - |R - dC|) of one channel without cancellation: -w |dC| <= result <= w |R|.
template <typename T>
T contributionOf(T signed_weight, T room, T colour_change) {
  const T change = signed_weight * colour_change;
  return std::min(change, room - change);
}

/// sqrt(a^2 + b^2) for a, b >= 0 without squares that could leave the range of T.
template <typename T>
T lengthOf(T a, T b) {
  const T larger = std::max(a, b);
  const T ratio = std::min(a, b) / std::max(larger, std::numeric_limits<T>::min());
  return larger * std::sqrt(T(1) + ratio * ratio);
}

/// Takes one splat off the pixel and adds to its sums [backwardFieldCount(mode)].
template <typename T>
void takeOff(const SplatAtPixel<T>& splat, const PixelLoss<T>& loss, BackwardMode mode,
             PixelBackward<T>& pixel, T* sums) {
  pixel.transmittance /= T(1) - splat.alpha;
  const T weight = pixel.transmittance * splat.alpha;
  T own = loss.gradient[3];
  for (int c = 0; c < 3; ++c) own += splat.colour[c] * loss.gradient[c];
  const T difference = own - pixel.behind;
  pixel.behind += splat.alpha * difference;
  const T s = splat.held ? T(0) : weight * difference;
  sums[kFieldS] += s;
  sums[kFieldG0] += s * splat.g0;
  sums[kFieldG1] += s * splat.g1;
  sums[kFieldG00] += s * splat.g0 * splat.g0;
  sums[kFieldG01] += s * splat.g0 * splat.g1;
  sums[kFieldG11] += s * splat.g1 * splat.g1;
  for (size_t c = 0; c < 3; ++c) sums[kFieldRed + c] += weight * loss.gradient[c];
  if (mode == BackwardMode::kGradients) return;

  for (int c = 0; c < 3; ++c) {
    const T over = splat.colour[c] - pixel.colour_behind[c];
    sums[kFieldContribution] += contributionOf(loss.signed_weight[c], loss.room[c], weight * over);
    pixel.colour_behind[c] += splat.alpha * over;
  }
  if (mode == BackwardMode::kContributions) return;

  const T by_x = T(kSquaredGScale) * s * (splat.g0 * splat.l00 + splat.g1 * splat.l10);
  const T by_y = T(kSquaredGScale) * s * (splat.g1 * splat.l11);
  sums[kFieldWeight] += weight;
  sums[kFieldEdge] += weight * loss.edge;
  sums[kFieldAbsoluteX] += std::abs(by_x);
  sums[kFieldAbsoluteY] += std::abs(by_y);
  sums[kFieldNorm] += lengthOf(std::abs(by_x), std::abs(by_y));
  sums[kFieldError] += weight * loss.error;
  sums[kFieldLargestError] = std::max(sums[kFieldLargestError], weight * loss.error);
}

}  // namespace stipple
