#include "data/clouds/cloud_comparison.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "data/clouds/splat_frame.h"

namespace stipple {

namespace {

/// Largest and mean of value(i), i < count.
template <typename Value>
Difference over(size_t count, const Value& value) {
  Difference difference;
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    const double one = value(i);
    difference.max = std::max(difference.max, one);
    sum += one;
  }
  if (count > 0) difference.mean = sum / static_cast<double>(count);
  return difference;
}

Difference between(const std::vector<float>& a, const std::vector<float>& b) {
  return over(a.size(), [&](size_t i) {
    return std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
  });
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
  if (!FrameConversion(b.frame, a.frame).isIdentity()) {
    SplatCloud turned = b;
    convertFrame(turned, a.frame);
    return compare(a, turned);
  }
  result.position = between(a.positions, b.positions);
  result.opacity = between(a.opacities, b.opacities);
  result.sh = between(a.sh, b.sh);
  result.scale_ratio = over(a.scales.size(), [&](size_t i) {
    if (a.scales[i] == b.scales[i]) return 0.0;
    return std::abs(std::log(static_cast<double>(a.scales[i]) / static_cast<double>(b.scales[i])));
  });
  result.rotation = over(a.size(), [&](size_t i) {
    return rotationBetween(&a.rotations[i * 4], &b.rotations[i * 4]);
  });
  return result;
}

}  // namespace stipple
