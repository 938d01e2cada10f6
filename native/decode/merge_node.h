#pragma once

#include <array>
#include <cstddef>
#include <numbers>

#include "data/cloud_extent.h"
#include "data/splat_cloud.h"

namespace stipple {

/// A splat, or what a group of splats was merged into. Lengths are in the units of the tree (the
/// cloud's own extent is about 1), so that squares and fourth powers stay in range. T: double, or
/// several at once.
template <class T>
struct MergeValues {
  std::array<T, 3> mean = {};
  std::array<T, 6> covariance = {};  ///< xx xy xz yy yz zz
  std::array<T, 3> colour = {};      ///< mean over directions, clamped at 0
  /// Per coordinate plane xy, xz, yz: sqrt of the determinant of the projected covariance, through
  /// the low-pass.
  std::array<T, 3> plane_size = {};
  T opacity = T(0.0);
  T visibility = T(1.0);  ///< 0..1: share that is seen, averaged over the views
  /// Root of the visibility: squared errors add over the views that see the splat.
  T contrast = T(1.0);
  T weight = T(0.0);  ///< of the moments: visible mass, the sum over the leaves below
  T depth = T(0.0);   ///< integral of the optical depth over the area, over 2 pi
  T area = T(0.0);    ///< projected, averaged over directions, over 2 pi
};

/// Whole cache lines of doubles: costs of many are taken at once (merge_cost.h).
struct alignas(64) MergeNode : MergeValues<double> {};

/// What all merges of one tree share.
struct MergeScale {
  std::array<double, 3> centre = {};  ///< metres
  double unit = 1;                    ///< metres
  double footprint = 0;               ///< variance of the low-pass that errors are seen through
};

/// The scale of a tree over a cloud of this extent. In: footprint: standard deviation of the
/// low-pass, metres; 0: automatic (MergeTreeOptions).
MergeScale mergeScale(const CloudExtent& extent, double footprint);

/// The integral of the optical depth -ln(1 - o exp(-r^2 / 2)) r dr: the dilogarithm of o.
double opticalDepth(double opacity);
/// Its inverse; at most kMergeMaxOpacity.
double opacityOfDepth(double depth);
/// Largest opacity that a merge gives.
constexpr double kMergeMaxOpacity = 0.9999;
/// Depth of an opacity of 1.
constexpr double kLargestDepth = std::numbers::pi * std::numbers::pi / 6;

/// Opacity over depth in equal steps of depth as pieces of cubic Hermite polynomials.
struct OpacityTable {
  static constexpr size_t kPieces = 512;
  static constexpr double kStep = kLargestDepth / kPieces;
  /// Value and slope, by depth, at the ends of the pieces.
  std::array<double, 2 * (kPieces + 1)> ends;
};
const OpacityTable& opacityTable();

/// Coverage counts beside colour, as what stands behind is not known; measured best on scans of
/// people and things (0.1 to 1 are alike within 0.3 dB).
constexpr double kCoverageShare = 0.3;
/// Errors of shape show against a surrounding that is likely to be alike: this share of the merged
/// colour is taken off.
constexpr double kLikeSurrounding = 0.3;
/// Variances below this of a degenerate splat, in units of the tree, cannot be told apart from 0.
constexpr double kSmallestDeterminant = 1e-60;
/// Below this an exponential is far below the errors of moments: 0.
constexpr double kLeastExponent = -40;

/// Entries of the covariance that a coordinate plane keeps, and its axes.
constexpr size_t kPlaneEntries[3][3] = {{0, 1, 3}, {0, 2, 5}, {3, 4, 5}};
constexpr size_t kPlaneAxes[3][2] = {{0, 1}, {0, 2}, {1, 2}};

MergeNode leafNode(const SplatCloud& cloud, size_t index, double visibility,
                   const MergeScale& scale);

/// Moment match: mean, covariance and colour are those of the mixture with the nodes' weights; the
/// optical depth of both, a hidden one counted as far as it is seen, is spread over the new area.
MergeNode mergedNode(const MergeNode& a, const MergeNode& b, const MergeScale& scale);

/// What merging does to pictures: the integral of the squared change of colour and coverage over
/// the three coordinate planes, seen through the low-pass, weighted by contrast.
double mergeError(const MergeNode& a, const MergeNode& b, const MergeNode& merged,
                  const MergeScale& scale);

/// Writes what a node looks like into splat `index` of a cloud, all but the harmonics.
void writeNode(const MergeNode& node, const MergeScale& scale, SplatCloud& cloud, size_t index);

}  // namespace stipple
