#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "splat/render/blend.h"

// One pixel of splat/render/blend.h backwards, from its last splat to its first. With B the colour
// behind a splat, the background included, and T the transmittance before it,
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
  kEdges = 3,          ///< and edge weights alone, which many steps of a fit ask for; without depth
  kWeights = 4,        ///< blending weights and no gradient
};

struct BackwardWants {
  BackwardMode mode;
  bool depth;  ///< the loss depends on the expected depth too

  bool operator==(const BackwardWants&) const = default;
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
  kFieldWeightAlone = 0,
  kWeightFieldCount,
  kFieldEdgeAlone = kGradientFieldCount,
  kEdgeFieldCount,
  kFieldContribution = kGradientFieldCount,
  kContributionFieldCount,
  kFieldWeight = kContributionFieldCount,
  kFieldEdge,
  kFieldAbsoluteX,  ///< sum of |dL/d centre x| of one pixel, pixels
  kFieldAbsoluteY,
  kFieldNorm,
  kFieldError,
  kFieldLargestError,  ///< a maximum, not a sum
  kFieldPixels,        ///< that show the splat
  kFieldPixelErrors,   ///< their errors, without weights
  kFieldDistances,     ///< of theirs from the centre, pixels
  kStatisticsFieldCount,
  kMostFields,  ///< with depth
};

/// Of the sums before dL/d(depth of the splat), which comes last where it is wanted.
constexpr size_t fieldCountOf(BackwardMode mode) {
  return mode == BackwardMode::kGradients       ? kGradientFieldCount
         : mode == BackwardMode::kEdges         ? kEdgeFieldCount
         : mode == BackwardMode::kWeights       ? kWeightFieldCount
         : mode == BackwardMode::kContributions ? kContributionFieldCount
                                                : kStatisticsFieldCount;
}

constexpr size_t backwardFieldCount(BackwardWants wants) {
  return fieldCountOf(wants.mode) + (wants.depth ? 1 : 0);
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
  T depth;
};

/// The loss at one pixel. With R the residual and w its weight: signed_weight = w sign(R), room =
/// 2 w |R|.
template <typename T>
struct PixelLoss {
  T gradient[4];     ///< dL/d(red, green, blue, alpha)
  T depth;           ///< the pixel's expected depth
  T depth_gradient;  ///< dL/d(that) over the pixel's coverage
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
  T signed_behind[3];  ///< colour behind times signed_weight; kept for contributions only
};

/// sqrt(a^2 + b^2) for a, b >= 0 without squares that could leave the range of T.
template <typename T>
T lengthOf(T a, T b) {
  const T larger = std::max(a, b);
  const T ratio = std::min(a, b) / std::max(larger, std::numeric_limits<T>::min());
  return larger * std::sqrt(T(1) + ratio * ratio);
}

/// Ends of what offsetOf divides by and gives: splats that are larger than any picture by far.
constexpr double kLeastSlope = 1e-12;
constexpr double kMostOffset = 1e6;  ///< pixels

/// Pixels from the centre along one axis, from g = l * offset, l > 0.
template <typename T>
T offsetOf(T g, T l) {
  return std::clamp(g / std::max(l, T(kLeastSlope)), T(-kMostOffset), T(kMostOffset));
}

/// Takes one splat off the pixel and adds to its sums [backwardFieldCount(wants)].
///
/// With D = sum(w z)/A, A = 1 - T the coverage, dD = (sum(z dw) - D sum(dw))/A: depth is a fourth
/// colour z - D over nothing, whose derivative is dL/dD / A.
template <typename T>
void takeOff(const SplatAtPixel<T>& splat, const PixelLoss<T>& loss, BackwardWants wants,
             PixelBackward<T>& pixel, T* sums) {
  pixel.transmittance /= T(1) - splat.alpha;
  const T weight = pixel.transmittance * splat.alpha;
  if (wants.mode == BackwardMode::kWeights) {
    sums[kFieldWeightAlone] += weight;
    return;
  }
  T own = loss.gradient[3];
  for (int c = 0; c < 3; ++c) own += splat.colour[c] * loss.gradient[c];
  if (wants.depth) {
    own += (splat.depth - loss.depth) * loss.depth_gradient;
    sums[backwardFieldCount(wants) - 1] += weight * loss.depth_gradient;
  }
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
  if (wants.mode == BackwardMode::kGradients) return;
  if (wants.mode == BackwardMode::kEdges) {
    sums[kFieldEdgeAlone] += weight * loss.edge;
    return;
  }

  // w (|R| - |R - dC|) per channel without cancellation: with x = w sign(R) dC it is
  // min(x, 2 w |R| - x), so -w |dC| <= result <= w |R|.
  for (int c = 0; c < 3; ++c) {
    const T over = loss.signed_weight[c] * splat.colour[c] - pixel.signed_behind[c];
    const T change = weight * over;
    sums[kFieldContribution] += std::min(change, loss.room[c] - change);
    pixel.signed_behind[c] += splat.alpha * over;
  }
  if (wants.mode == BackwardMode::kContributions) return;

  const T by_x = T(kSquaredGScale) * s * (splat.g0 * splat.l00 + splat.g1 * splat.l10);
  const T by_y = T(kSquaredGScale) * s * (splat.g1 * splat.l11);
  sums[kFieldWeight] += weight;
  sums[kFieldEdge] += weight * loss.edge;
  sums[kFieldAbsoluteX] += std::abs(by_x);
  sums[kFieldAbsoluteY] += std::abs(by_y);
  sums[kFieldNorm] += lengthOf(std::abs(by_x), std::abs(by_y));
  sums[kFieldError] += weight * loss.error;
  sums[kFieldLargestError] = std::max(sums[kFieldLargestError], weight * loss.error);

  const T dx = offsetOf(splat.g0, splat.l00);
  const T dy = offsetOf(splat.g1 - splat.l10 * dx, splat.l11);
  sums[kFieldPixels] += T(1);
  sums[kFieldPixelErrors] += loss.error;
  sums[kFieldDistances] += lengthOf(std::abs(dx), std::abs(dy));
}

}  // namespace stipple
