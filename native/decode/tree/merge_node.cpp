#include "decode/tree/merge_node.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "math/covariance.h"
#include "math/principal_axes.h"
#include "math/quaternion.h"

// Based on: Crouse, Willett, Pattipati, Svensson, A Look at Gaussian Mixture Reduction Algorithms,
// FUSION 2011 (moment match; squared L2 distance of Gaussian mixtures in closed form).
// Differs: distances are taken of what the splats add to pictures, projected along three
// orthogonal axes, not of densities in space, where thin splats would count without bound; opacity
// follows from the integral of the optical depth.

namespace stipple {

namespace {

/// Extent of the cloud over the default footprint: half a pixel where it fills a picture of 800.
constexpr double kFootprintsPerRadius = 760;

OpacityTable makeOpacityTable() {
  OpacityTable table;
  for (size_t i = 0; i <= OpacityTable::kPieces; ++i) {
    const double depth = OpacityTable::kStep * static_cast<double>(i);
    double low = 0;
    double high = 1;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (opticalDepth(middle) < depth ? low : high) = middle;
    }
    table.ends[2 * i] = low;
    // d o / d depth = o / (-ln(1 - o)) is smooth: 1 at o = 0; 0 at o = 1.
    const double u = i < OpacityTable::kPieces ? -std::log1p(-low) : 0;
    table.ends[2 * i + 1] = i == 0 ? 1.0 : i == OpacityTable::kPieces ? 0.0 : low / u;
  }
  return table;
}

#include "decode/tree/merge_numbers-inl.h"
#include "decode/tree/merge_steps-inl.h"

}  // namespace

MergeScale mergeScale(const CloudExtent& extent, double footprint) {
  MergeScale scale;
  scale.centre = extent.centre;
  scale.unit = extent.radius;
  const double share = footprint > 0 ? footprint / extent.radius : 1 / kFootprintsPerRadius;
  scale.footprint = share * share;
  return scale;
}

double opticalDepth(double opacity) {
  // Li2(1 - e^-u) is the Debye-like integral of t / (e^t - 1) from 0 to u; beyond o = 1/2 Euler's
  // reflection Li2(o) + Li2(1 - o) = pi^2/6 - ln(o) ln(1 - o) keeps u small, so the series of
  // Bernoulli numbers below ends at a relative error of 1e-12.
  if (!(opacity > 0)) return 0;
  if (opacity >= 1) return kLargestDepth;
  if (opacity > 0.5) {
    return kLargestDepth - std::log(opacity) * std::log1p(-opacity) - opticalDepth(1 - opacity);
  }
  const double u = -std::log1p(-opacity);
  const double s = u * u;
  return u - s / 4 +
         u * s *
             (1.0 / 36 -
              s * (1.0 / 3600 - s * (1.0 / 211680 - s * (1.0 / 10886400 - s * (1.0 / 526901760)))));
}

const OpacityTable& opacityTable() {
  static const OpacityTable table = makeOpacityTable();
  return table;
}

double opacityOfDepth(double depth) {
  return opacityByTable(depth);
}

void measureNode(MergeNode& node, const MergeScale& scale) {
  measureArea<double>(node, scale.footprint);
  measurePlanes<double>(node, scale.footprint);
}

MergeNode leafNode(const SplatCloud& cloud, size_t index, double visibility,
                   const MergeScale& scale) {
  MergeNode node;
  const Mat3d covariance =
      stipple::covariance<double>(&cloud.rotations[index * 4], &cloud.scales[index * 3]) /
      (scale.unit * scale.unit);
  node.covariance = {covariance(0, 0), covariance(0, 1), covariance(0, 2),
                     covariance(1, 1), covariance(1, 2), covariance(2, 2)};
  const float* sh = &cloud.sh[index * cloud.shStride()];
  for (size_t axis = 0; axis < 3; ++axis) {
    node.mean[axis] =
        (static_cast<double>(cloud.positions[index * 3 + axis]) - scale.centre[axis]) / scale.unit;
    node.colour[axis] =
        std::max(0.0, 0.5 + static_cast<double>(kShC0) * static_cast<double>(sh[axis]));
  }
  measureNode(node, scale);
  node.leaf_area = node.area;
  node.opacity = std::min(static_cast<double>(cloud.opacities[index]), kMergeMaxOpacity);
  node.depth = opticalDepth(node.opacity) * node.area;
  node.visibility = visibility;
  node.contrast = std::sqrt(visibility);
  node.weight = visibility * node.opacity * node.area;
  return node;
}

MergeNode mergedNode(const MergeNode& a, const MergeNode& b, const MergeScale& scale) {
  MergeNode node;
  mergeMoments<double>(a, b, scale.footprint, node);
  return node;
}

void Surrounding::add(const MergeNode& neighbour) {
  const double weight = neighbour.opacity * neighbour.area;
  for (size_t c = 0; c < 3; ++c) colour_[c] += weight * neighbour.colour[c];
  opacity_ += weight * neighbour.opacity;
  weight_ += weight;
}

std::array<double, 3> Surrounding::mean() const {
  if (!(weight_ > 0)) return {};
  const double share = kSurroundingShare + kOpaqueSurroundingShare * opacity_ / weight_;
  return {share * colour_[0] / weight_, share * colour_[1] / weight_, share * colour_[2] / weight_};
}

double mergeError(const MergeNode& a, const MergeNode& b, const MergeNode& merged,
                  const MergeScale& scale) {
  return errorOfMerge<double>(a, b, merged, scale.footprint);
}

void writeNode(const MergeNode& node, const MergeScale& scale, SplatCloud& cloud, size_t index,
               const float* like) {
  const auto& c = node.covariance;
  Mat3d covariance;
  covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  covariance *= node.inflation;
  if (like) covariance = (covariance * rotationFromQuaternion<double>(like)).eval();
  // Of a symmetric matrix without negative eigenvalues, lengths are the eigenvalues.
  const PrincipalAxes principal = principalAxes(covariance);
  const Vec4d quaternion = quaternionFromRotation(principal.axes);
  for (size_t axis = 0; axis < 3; ++axis) {
    cloud.positions[index * 3 + axis] =
        static_cast<float>(node.mean[axis] * scale.unit + scale.centre[axis]);
    cloud.scales[index * 3 + axis] =
        static_cast<float>(std::sqrt(principal.lengths[static_cast<int>(axis)]) * scale.unit);
  }
  for (size_t k = 0; k < 4; ++k) {
    cloud.rotations[index * 4 + k] = static_cast<float>(quaternion[static_cast<int>(k)]);
  }
  cloud.opacities[index] = static_cast<float>(node.opacity);
}

}  // namespace stipple
