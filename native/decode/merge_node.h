#pragma once

#include <array>
#include <cstddef>

#include "data/cloud_extent.h"
#include "data/splat_cloud.h"

namespace stipple {

/// A splat, or what a group of splats was merged into. Lengths are in the units of the tree (the
/// cloud's own extent is about 1), so that squares and fourth powers stay in range.
struct MergeNode {
  std::array<double, 3> mean = {};
  std::array<double, 6> covariance = {};  ///< xx xy xz yy yz zz
  std::array<double, 3> colour = {};      ///< mean over directions, clamped at 0
  double opacity = 0;
  double visibility = 1;  ///< 0..1: share that is seen, averaged over the views
  /// Root of the visibility: squared errors add over the views that see the splat.
  double contrast = 1;
  double weight = 0;  ///< of the moments: visible mass, the sum over the leaves below
  double area = 0;    ///< projected, averaged over directions, over 2 pi
  double depth = 0;   ///< integral of the optical depth over that area, over 2 pi
  /// Per coordinate plane xy, xz, yz: sqrt of the determinant of the projected covariance, and
  /// integral of the squared unit-mass Gaussian.
  std::array<double, 3> plane_size = {};
  std::array<double, 3> plane_energy = {};
};

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
