#include "data/clouds/cloud_blend.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;

/// In double, so that what is the same in both stays bit for bit and nothing overflows on the way.
void blendRows(const std::vector<float>& from, const std::vector<float>& to, double share,
               size_t begin, size_t end, std::vector<float>& out) {
  const double rest = 1 - share;
  const float* a = from.data();
  const float* b = to.data();
  float* o = out.data();
  for (size_t i = begin; i < end; ++i) {
    o[i] = static_cast<float>(rest * static_cast<double>(a[i]) + share * static_cast<double>(b[i]));
  }
}

void blendRotation(const float* from, const float* to, double share, float* out) {
  if (std::equal(from, from + 4, to)) {
    std::copy_n(from, 4, out);
    return;
  }
  double dot = 0, from_square = 0, to_square = 0;
  for (size_t k = 0; k < 4; ++k) {
    const double a = static_cast<double>(from[k]), b = static_cast<double>(to[k]);
    dot += a * b;
    from_square += a * a;
    to_square += b * b;
  }
  // Quaternions of opposite signs are the same rotation.
  const double from_share = (1 - share) / std::sqrt(from_square);
  const double to_share = (dot < 0 ? -share : share) / std::sqrt(to_square);
  double made[4], square = 0;
  for (size_t k = 0; k < 4; ++k) {
    made[k] = from_share * static_cast<double>(from[k]) + to_share * static_cast<double>(to[k]);
    square += made[k] * made[k];
  }
  // At least half: the angle between the two is at most a right one.
  const double scale = 1 / std::sqrt(square);
  for (size_t k = 0; k < 4; ++k) out[k] = static_cast<float>(scale * made[k]);
}

}  // namespace

void blendClouds(const SplatCloud& from, const SplatCloud& to, double share, SplatCloud& out) {
  if (from.size() != to.size() || from.sh_degree != to.sh_degree) {
    fail(ErrorCode::kInvalidArgument,
         "clouds of " + std::to_string(from.size()) + " splats of degree " +
             std::to_string(from.sh_degree) + " and of " + std::to_string(to.size()) +
             " of degree " + std::to_string(to.sh_degree) +
             " have nothing between them; as many of one degree are needed");
  }
  out.sh_degree = from.sh_degree;
  out.colour_space = from.colour_space;
  out.antialias = from.antialias;
  out.frame = from.frame;
  out.resize(from.size());
  const size_t stride = from.shStride();
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    blendRows(from.positions, to.positions, share, 3 * begin, 3 * end, out.positions);
    blendRows(from.scales, to.scales, share, 3 * begin, 3 * end, out.scales);
    blendRows(from.opacities, to.opacities, share, begin, end, out.opacities);
    blendRows(from.sh, to.sh, share, stride * begin, stride * end, out.sh);
    for (size_t i = begin; i < end; ++i) {
      blendRotation(&from.rotations[4 * i], &to.rotations[4 * i], share, &out.rotations[4 * i]);
    }
  });
}

}  // namespace stipple
