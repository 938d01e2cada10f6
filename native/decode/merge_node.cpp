#include "decode/merge_node.h"

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
constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kLargestDepth = std::numbers::pi * std::numbers::pi / 6;

/// Coverage counts beside colour, as what stands behind is not known; measured best on scans of
/// people and things (0.1 to 1 are alike within 0.3 dB).
constexpr double kCoverageShare = 0.3;
/// Errors of shape show against a surrounding that is likely to be alike: this share of the merged
/// colour is taken off.
constexpr double kLikeSurrounding = 0.3;
/// Variances below this of a degenerate splat, in units of the tree, cannot be told apart from 0.
constexpr double kSmallestDeterminant = 1e-60;

/// Entries of the covariance that a coordinate plane keeps, and its axes.
constexpr size_t kPlaneEntries[3][3] = {{0, 1, 3}, {0, 2, 5}, {3, 4, 5}};
constexpr size_t kPlaneAxes[3][2] = {{0, 1}, {0, 2}, {1, 2}};

/// Opacity over depth as cubic Hermite pieces: d o / d depth = o / (-ln(1 - o)) is smooth.
class OpacityTable {
 public:
  OpacityTable() {
    for (size_t i = 0; i <= kPieces; ++i) {
      const double depth = kLargestDepth * static_cast<double>(i) / kPieces;
      double low = 0;
      double high = 1;
      for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (low + high);
        (opticalDepth(middle) < depth ? low : high) = middle;
      }
      values_[i] = low;
      // Of o / u with u = -ln(1 - o): 1 at o = 0; 0 at o = 1.
      const double u = i < kPieces ? -std::log1p(-low) : 0;
      slopes_[i] = i == 0 ? 1.0 : i == kPieces ? 0.0 : low / u;
    }
  }

  double at(double depth) const {
    constexpr double kStep = kLargestDepth / kPieces;
    const double x = std::clamp(depth, 0.0, kLargestDepth) / kStep;
    const size_t piece = std::min<size_t>(static_cast<size_t>(x), kPieces - 1);
    const double t = x - static_cast<double>(piece);
    const double s = 1 - t;
    return s * s * (1 + 2 * t) * values_[piece] + t * t * (1 + 2 * s) * values_[piece + 1] +
           kStep * t * s * (s * slopes_[piece] - t * slopes_[piece + 1]);
  }

 private:
  static constexpr size_t kPieces = 512;
  double values_[kPieces + 1];
  double slopes_[kPieces + 1];
};

/// exp(x) for x <= 0, 0 below -40, where errors are far below those of moments. The reduced
/// argument is within ln 2 / 2 of 0; the series ends at a relative error of 1e-9.
double expNegative(double x) {
  if (!(x > -40)) return 0;
  constexpr double kLog2E = 1.4426950408889634;
  const double n = std::floor(x * kLog2E + 0.5);
  const double r = x - n * 0.6931471805599453;
  double sum = 1 + r * (1.0 / 7) * (1 + r * (1.0 / 8));
  sum = 1 + r * (1.0 / 6) * sum;
  sum = 1 + r * (1.0 / 5) * sum;
  sum = 1 + r * (1.0 / 4) * sum;
  sum = 1 + r * (1.0 / 3) * sum;
  sum = 1 + r * (1.0 / 2) * sum;
  sum = 1 + r * sum;
  return sum * std::bit_cast<double>(static_cast<uint64_t>(static_cast<int64_t>(n) + 1023) << 52);
}

/// Determinant of the symmetric matrix (xx xy; xy yy) after the low-pass of variance `blur`. Of a
/// needle, rounding would leave anything of xx yy - xy^2: below 0 it is 0, what the blur adds
/// stays.
double blurredDeterminant(double xx, double xy, double yy, double blur) {
  return std::max(std::max(xx * yy - xy * xy, 0.0) + blur * (xx + yy + blur), kSmallestDeterminant);
}

/// Integral of the product of two unit-mass Gaussians over a coordinate plane, through the
/// low-pass.
double planeProduct(const MergeNode& a, const MergeNode& b, size_t plane, double footprint) {
  const size_t* entries = kPlaneEntries[plane];
  const double xx = a.covariance[entries[0]] + b.covariance[entries[0]];
  const double xy = a.covariance[entries[1]] + b.covariance[entries[1]];
  const double yy = a.covariance[entries[2]] + b.covariance[entries[2]];
  const double blur = 2 * footprint;
  const double determinant = blurredDeterminant(xx, xy, yy, blur);
  const double dx = a.mean[kPlaneAxes[plane][0]] - b.mean[kPlaneAxes[plane][0]];
  const double dy = a.mean[kPlaneAxes[plane][1]] - b.mean[kPlaneAxes[plane][1]];
  const double squared =
      ((yy + blur) * dx * dx - 2 * xy * dx * dy + (xx + blur) * dy * dy) / determinant;
  // Along a needle rounding may leave less than 0.
  return expNegative(-0.5 * std::max(squared, 0.0)) / (kTwoPi * std::sqrt(determinant));
}

/// Fills what follows from the covariance.
void measure(MergeNode& node, double footprint) {
  double squares = 0;
  for (size_t plane = 0; plane < 3; ++plane) {
    const size_t* entries = kPlaneEntries[plane];
    const double determinant =
        blurredDeterminant(node.covariance[entries[0]], node.covariance[entries[1]],
                           node.covariance[entries[2]], footprint);
    squares += determinant;
    node.plane_size[plane] = std::sqrt(determinant);
    // The square of a Gaussian is one of half the variance.
    node.plane_energy[plane] = 1 / (2 * kTwoPi * node.plane_size[plane]);
  }
  // The sum of the squared areas over three orthogonal directions is the same for all of them.
  node.area = std::sqrt(squares / 3);
}

double dotColours(const MergeNode& a, const MergeNode& b, const std::array<double, 3>& behind) {
  double sum = kCoverageShare;
  for (size_t c = 0; c < 3; ++c) sum += (a.colour[c] - behind[c]) * (b.colour[c] - behind[c]);
  return sum;
}

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

double opacityOfDepth(double depth) {
  static const OpacityTable table;
  return std::min(table.at(depth), kMergeMaxOpacity);
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
  measure(node, scale.footprint);
  node.opacity = std::min(static_cast<double>(cloud.opacities[index]), kMergeMaxOpacity);
  node.depth = opticalDepth(node.opacity) * node.area;
  node.visibility = visibility;
  node.contrast = std::sqrt(visibility);
  node.weight = visibility * node.opacity * node.area;
  return node;
}

MergeNode mergedNode(const MergeNode& a, const MergeNode& b, const MergeScale& scale) {
  MergeNode node;
  node.weight = a.weight + b.weight;
  const double share_a = node.weight > 0 ? a.weight / node.weight : 0.5;
  const double share_b = 1 - share_a;
  std::array<double, 3> apart;
  for (size_t axis = 0; axis < 3; ++axis) {
    node.mean[axis] = share_a * a.mean[axis] + share_b * b.mean[axis];
    apart[axis] = a.mean[axis] - b.mean[axis];
    node.colour[axis] = share_a * a.colour[axis] + share_b * b.colour[axis];
  }
  const double spread = share_a * share_b;
  const double products[6] = {apart[0] * apart[0], apart[0] * apart[1], apart[0] * apart[2],
                              apart[1] * apart[1], apart[1] * apart[2], apart[2] * apart[2]};
  for (size_t i = 0; i < 6; ++i) {
    node.covariance[i] =
        share_a * a.covariance[i] + share_b * b.covariance[i] + spread * products[i];
  }
  measure(node, scale.footprint);
  node.visibility = share_a * a.visibility + share_b * b.visibility;
  node.contrast = share_a * a.contrast + share_b * b.contrast;
  // What stands behind the others adds to the coverage only as far as it is seen beside them.
  const double seen_a = a.visibility < node.visibility ? a.visibility / node.visibility : 1;
  const double seen_b = b.visibility < node.visibility ? b.visibility / node.visibility : 1;
  node.opacity = opacityOfDepth((seen_a * a.depth + seen_b * b.depth) / node.area);
  node.depth = std::min(seen_a * a.depth + seen_b * b.depth, kLargestDepth * node.area);
  return node;
}

double mergeError(const MergeNode& a, const MergeNode& b, const MergeNode& merged,
                  const MergeScale& scale) {
  std::array<double, 3> behind;
  for (size_t c = 0; c < 3; ++c) behind[c] = kLikeSurrounding * merged.colour[c];
  const double aa = dotColours(a, a, behind);
  const double bb = dotColours(b, b, behind);
  const double mm = dotColours(merged, merged, behind);
  const double ab = dotColours(a, b, behind);
  const double am = dotColours(a, merged, behind);
  const double bm = dotColours(b, merged, behind);
  const double in_a = kTwoPi * a.contrast * a.opacity;
  const double in_b = kTwoPi * b.contrast * b.opacity;
  const double in_m = kTwoPi * merged.contrast * merged.opacity;
  double error = 0;
  for (size_t plane = 0; plane < 3; ++plane) {
    const double mass_a = in_a * a.plane_size[plane];
    const double mass_b = in_b * b.plane_size[plane];
    const double mass_m = in_m * merged.plane_size[plane];
    error += mass_a * mass_a * aa * a.plane_energy[plane] +
             mass_b * mass_b * bb * b.plane_energy[plane] +
             mass_m * mass_m * mm * merged.plane_energy[plane] +
             2 * (mass_a * mass_b * ab * planeProduct(a, b, plane, scale.footprint) -
                  mass_a * mass_m * am * planeProduct(a, merged, plane, scale.footprint) -
                  mass_b * mass_m * bm * planeProduct(b, merged, plane, scale.footprint));
  }
  return std::max(error, 0.0);
}

void writeNode(const MergeNode& node, const MergeScale& scale, SplatCloud& cloud, size_t index) {
  const auto& c = node.covariance;
  Mat3d covariance;
  covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
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
