#include "decode/field/field_details.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "math/quaternion_turn.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 512;
/// Details change sizes by no more than a factor of 150, and odds by no more than float32 holds.
constexpr float kLargestLogScale = 5;
constexpr float kLargestLogit = 40;
/// Half a turn but for 1e-6; the square of a file's largest number would leave float32.
constexpr float kLargestTurn = 1e6f;

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

std::array<float, 3> turnOf(const float* detail) {
  std::array<float, 3> turn;
  for (size_t axis = 0; axis < 3; ++axis) {
    turn[axis] = std::clamp(kShapeShare * detail[kDetailTurn + axis], -kLargestTurn, kLargestTurn);
  }
  return turn;
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
      turnQuaternion(turnOf(detail).data(), &cloud.rotations[n * 4]);
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
      if (!hasShapes(channels)) continue;
      float* by_turn = to + kDetailTurn;
      turnQuaternionBackward(turnOf(detail).data(), &cloud.rotations[n * 4],
                             &gradient.rotations[n * 4], by_turn);
      for (size_t axis = 0; axis < 3; ++axis) by_turn[axis] *= kShapeShare;
    }
  });
}

}  // namespace stipple
