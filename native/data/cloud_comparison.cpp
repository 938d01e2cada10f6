#include "data/cloud_comparison.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stipple {

namespace {

double largestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  return largest;
}

/// Angle of the rotation between two quaternions of any length, radians. Uses atan2 of both parts
/// of the quotient: acos of the dot product cannot tell angles below 1e-8 apart.
double rotationBetween(const float* p, const float* q) {
  const double pw = p[0], px = p[1], py = p[2], pz = p[3];
  const double qw = q[0], qx = q[1], qy = q[2], qz = q[3];
  const double w = pw * qw + px * qx + py * qy + pz * qz;
  const double x = pw * qx - px * qw - py * qz + pz * qy;
  const double y = pw * qy + px * qz - py * qw - pz * qx;
  const double z = pw * qz - px * qy + py * qx - pz * qw;
  return 2.0 * std::atan2(std::sqrt(x * x + y * y + z * z), std::abs(w));
}

}  // namespace

CloudComparison compare(const SplatCloud& a, const SplatCloud& b) {
  CloudComparison result;
  result.same_order = a.size() == b.size() && a.sh_degree == b.sh_degree;
  if (!result.same_order) return result;
  result.max_position = largestDifference(a.positions, b.positions);
  result.max_opacity = largestDifference(a.opacities, b.opacities);
  result.max_sh = largestDifference(a.sh, b.sh);
  for (size_t i = 0; i < a.scales.size(); ++i) {
    if (a.scales[i] == b.scales[i]) continue;
    const double ratio = static_cast<double>(a.scales[i]) / static_cast<double>(b.scales[i]);
    result.max_scale_ratio = std::max(result.max_scale_ratio, std::abs(std::log(ratio)));
  }
  for (size_t i = 0; i < a.size(); ++i) {
    result.max_rotation =
        std::max(result.max_rotation, rotationBetween(&a.rotations[i * 4], &b.rotations[i * 4]));
  }
  return result;
}

}  // namespace stipple
