#include "decode/field_details.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/parallel.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
/// Details change sizes by no more than a factor of 150, and odds by no more than float32 holds.
constexpr float kLargestLogScale = 5;
constexpr float kLargestLogit = 40;

bool hasShapes(size_t channels) {
  return channels > kChannelsWithoutShapes;
}

/// Logarithm of what the scale of an axis is multiplied by.
float logScale(const float* detail, size_t channels, size_t axis) {
  return detail[kDetailScale] +
         (hasShapes(channels) ? kShapeShare * detail[kDetailScales + axis] : 0.0f);
}

float scaleFactor(float log_scale) {
  return std::exp(std::clamp(log_scale, -kLargestLogScale, kLargestLogScale));
}

Eigen::Quaternionf quaternionOf(const float* wxyz) {
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

void store(const Eigen::Quaternionf& q, float* wxyz) {
  wxyz[0] = q.w();
  wxyz[1] = q.x();
  wxyz[2] = q.y();
  wxyz[3] = q.z();
}

/// Its length is at least 1.
Eigen::Quaternionf turnOf(const float* detail) {
  const float* r = detail + kDetailTurn;
  return {1.0f, kShapeShare * r[0], kShapeShare * r[1], kShapeShare * r[2]};
}

/// q = u p / |u| for the turn u and the unit quaternion p without it. In: rotation: q. In and out:
/// by_rotation: derivatives by q, which become those by p. Out: by_turn: by the vector part of u.
void turnBackward(const float* detail, const float* rotation, float* by_rotation, float* by_turn) {
  const Eigen::Quaternionf turn = turnOf(detail);
  const Eigen::Quaternionf q = quaternionOf(rotation);
  const Eigen::Quaternionf by_q = quaternionOf(by_rotation);
  const float length = turn.norm();
  const Eigen::Quaternionf p((turn.conjugate() * q).coeffs() / length);
  // Across q, as its length stays 1.
  const Eigen::Quaternionf by_product((by_q.coeffs() - by_q.dot(q) * q.coeffs()) / length);
  const Eigen::Quaternionf by_u = by_product * p.conjugate();
  by_turn[0] = kShapeShare * by_u.x();
  by_turn[1] = kShapeShare * by_u.y();
  by_turn[2] = kShapeShare * by_u.z();
  store(turn.conjugate() * by_product, by_rotation);
}

}  // namespace

void addDetails(const FieldDetails& how, std::span<const float> details, SplatCloud& cloud) {
  const size_t channels = how.channels;
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      const float* detail = &details[n * channels];
      for (size_t c = 0; c < 3; ++c) cloud.sh[n * cloud.shStride() + c] += detail[c];
      if (channels <= kColourChannels) continue;
      // logistic(logit(o) + d) without the logit, which 0 and 1 have none of.
      const float odds =
          std::exp(std::clamp(detail[kDetailOpacity], -kLargestLogit, kLargestLogit));
      const float o = cloud.opacities[n];
      cloud.opacities[n] = o * odds / (1.0f - o + o * odds);
      for (size_t axis = 0; axis < 3; ++axis) {
        cloud.scales[n * 3 + axis] *= scaleFactor(logScale(detail, channels, axis));
        cloud.positions[n * 3 + axis] += how.footprints[n] * detail[kDetailOffset + axis];
      }
      if (!hasShapes(channels)) continue;
      float* q = &cloud.rotations[n * 4];
      store((turnOf(detail) * quaternionOf(q)).normalized(), q);
    }
  });
}

void addDetailsBackward(const FieldDetails& how, std::span<const float> details, float side,
                        const SplatCloud& cloud, SplatCloud& gradient,
                        std::span<float> by_details) {
  const size_t channels = how.channels;
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t n = begin; n < end; ++n) {
      float* to = &by_details[n * channels];
      for (size_t c = 0; c < 3; ++c) to[c] = gradient.sh[n * cloud.shStride() + c];
      if (channels <= kColourChannels) continue;
      const float* detail = &details[n * channels];
      const float o = cloud.opacities[n];
      to[kDetailOpacity] = gradient.opacities[n] * o * (1.0f - o);
      const float size = how.stretch.empty() ? side : side * how.stretch[n];
      to[kDetailScale] = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        const float log_scale = logScale(detail, channels, axis);
        float& by_scale = gradient.scales[n * 3 + axis];
        const bool is_free = std::abs(log_scale) < kLargestLogScale;
        const float by_log = is_free ? by_scale * cloud.scales[n * 3 + axis] / size : 0.0f;
        to[kDetailScale] += by_log;
        if (hasShapes(channels)) to[kDetailScales + axis] = kShapeShare * by_log;
        by_scale *= scaleFactor(log_scale);
        to[kDetailOffset + axis] = how.footprints[n] * gradient.positions[n * 3 + axis];
      }
      if (hasShapes(channels)) {
        turnBackward(detail, &cloud.rotations[n * 4], &gradient.rotations[n * 4], to + kDetailTurn);
      }
    }
  });
}

}  // namespace stipple
