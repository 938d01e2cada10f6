#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "data/clouds/cloud_extent.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// A splat, or what a group of splats was merged into. Lengths are in the units of the tree (the
/// cloud's own extent is about 1), so that squares and fourth powers stay in range. T: double, or
/// several at once.
template <class T>
struct MergeValues {
  // What a neighbour is asked for when others look around: one cache line of doubles.
  std::array<T, 3> mean = {};
  std::array<T, 3> colour = {};  ///< mean over directions, clamped at 0
  T opacity = T(0.0);
  T area = T(0.0);  ///< of the covariance, projected, averaged over directions, over 2 pi

  std::array<T, 6> covariance = {};  ///< xx xy xz yy yz zz
  /// Per coordinate plane xy, xz, yz: sqrt of the determinant of what is drawn, projected, through
  /// the low-pass.
  std::array<T, 3> plane_size = {};
  T visibility = T(1.0);  ///< 0..1: share that is seen, averaged over the views
  /// Root of the visibility: squared errors add over the views that see the splat.
  T contrast = T(1.0);
  T weight = T(0.0);  ///< of the moments: visible mass, the sum over the leaves below
  T depth = T(0.0);   ///< integral of the optical depth over the picture, over 2 pi
  /// What is drawn has this many times the covariance: mergeMoments.
  T inflation = T(1.0);
  T leaf_area = T(0.0);  ///< mean area of the leaves below
  /// Mean colour of the neighbours, by how far it is likely to stand behind this node: what errors
  /// of shape show against. Filled in by who knows the neighbours (Surrounding).
  std::array<T, 3> around = {};
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

/// Coverage counts beside colour, as what stands behind is not known.
constexpr double kCoverageShare = 0.07;
/// Errors of shape show against the neighbours' mean colour by this share, and by the second one
/// as far as the neighbours are opaque: what stands behind faint ones is not known.
constexpr double kSurroundingShare = 0.45;
constexpr double kOpaqueSurroundingShare = 0.45;
/// From this visibility on a node that lies open is drawn as large as its gaps ask for.
constexpr double kFullInflationVisibility = 0.2;
/// Variances below this of a degenerate splat, in units of the tree, cannot be told apart from 0.
constexpr double kSmallestDeterminant = 1e-60;
/// Less half of a number's bits: the bits of about 1 / sqrt of it (within 3.5 %).
constexpr uint64_t kRootGuess = 0x5fe6eb50c7b537a9;
/// Bits of a double's digits, and those of 1.
constexpr uint64_t kMantissaBits = 0x000fffffffffffff;
constexpr uint64_t kBitsOfOne = 0x3ff0000000000000;
/// Below this an exponential is far below the errors of moments: 0.
constexpr double kLeastExponent = -40;

/// Entries of the covariance that a coordinate plane keeps, and its axes.
constexpr size_t kPlaneEntries[3][3] = {{0, 1, 3}, {0, 2, 5}, {3, 4, 5}};
constexpr size_t kPlaneAxes[3][2] = {{0, 1}, {0, 2}, {1, 2}};

/// Fills the area and the plane sizes of a node without inflation, which follow from its
/// covariance.
void measureNode(MergeNode& node, const MergeScale& scale);

MergeNode leafNode(const SplatCloud& cloud, size_t index, double visibility,
                   const MergeScale& scale);

/// Moment match: mean, covariance and colour are those of the mixture with the nodes' weights; the
/// optical depth of both, a hidden one counted as far as it is seen, is spread over the new area.
/// Where that asks for more than an opacity of 1 and the leaves lie apart, the node is drawn larger
/// than its moments, at most twice as large in area: Gaussians with the moments of their share of a
/// surface leave gaps between each other. What is hidden is not, it would show around what hides
/// it.
MergeNode mergedNode(const MergeNode& a, const MergeNode& b, const MergeScale& scale);

/// The sum over neighbours that `around` is the mean of.
class Surrounding {
 public:
  void add(const MergeNode& neighbour);
  std::array<double, 3> mean() const;

 private:
  std::array<double, 3> colour_ = {};
  double opacity_ = 0;
  double weight_ = 0;
};

/// What merging does to pictures: the integral of the squared change of colour and coverage over
/// the three coordinate planes, before what is around both, seen through the low-pass, weighted by
/// contrast.
double mergeError(const MergeNode& a, const MergeNode& b, const MergeNode& merged,
                  const MergeScale& scale);

/// Writes what a node looks like into splat `index` of a cloud, all but the harmonics. `like`: a
/// quaternion whose axes those of the splat are nearest to, in their order; null: those of space.
void writeNode(const MergeNode& node, const MergeScale& scale, SplatCloud& cloud, size_t index,
               const float* like = nullptr);

}  // namespace stipple
