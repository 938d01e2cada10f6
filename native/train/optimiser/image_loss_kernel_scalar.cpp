// The definition of each row operation in plain C++; image_loss_kernel_vector.cpp does the same
// with lanes along the row.

#include <algorithm>
#include <cmath>

#include "train/optimiser/image_loss_kernel.h"

namespace stipple {

namespace {

template <class Float>
Float* channelOf(const PixelRun<Float>& run, size_t pixel, size_t channel) {
  switch (run.layout) {
    case PixelLayout::kRgb:
      return run.first + pixel * 3 + channel;
    case PixelLayout::kRgba:
      return run.first + pixel * 4 + channel;
    case PixelLayout::kPlanar:
      break;
  }
  return run.first + channel * run.plane_stride + pixel;
}

bool isUsable(float colour) {
  return std::isfinite(colour) && std::abs(colour) <= kLargestColour;
}

bool readPixels(PixelRun<const float> rendered, PixelRun<const float> target, size_t count,
                float* const sums[3], float* const differences[3]) {
  bool all_usable = true;
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      float x = *channelOf(rendered, i, c);
      float y = *channelOf(target, i, c);
      all_usable = all_usable && isUsable(x) && isUsable(y);
      if (!isUsable(x)) x = 0;
      if (!isUsable(y)) y = 0;
      sums[c][i] = x + y;
      differences[c][i] = x - y;
    }
  }
  return all_usable;
}

template <class Value>
float blurredAt(const Value& value) {
  float sum = kBlurWindow[kBlurReach] * value(kBlurReach);
  for (size_t k = 0; k < kBlurReach; ++k) {
    sum += kBlurWindow[k] * (value(k) + value(kBlurTaps - 1 - k));
  }
  return sum;
}

void blurStatistics(const float* const* sums, const float* const* differences, size_t count,
                    float* const* statistics) {
  for (size_t row = 0; row < kBlockRows; ++row) {
    const float* const* p = sums + row;
    const float* const* d = differences + row;
    float* const* out = statistics + 4 * row;
    for (size_t i = 0; i < count; ++i) {
      out[0][i] = blurredAt([&](size_t k) { return p[k][i]; });
      out[1][i] = blurredAt([&](size_t k) { return d[k][i]; });
      out[2][i] = blurredAt([&](size_t k) { return p[k][i] * p[k][i]; });
      out[3][i] = blurredAt([&](size_t k) { return d[k][i] * d[k][i]; });
    }
  }
}

// With mp, md the blurred p and d: P = mp^2/2, D = md^2/2, V and W half the windows' variances of p
// and d. Then 2 mx my = P - D, mx^2 + my^2 = P + D, and so for the (co)variances, so that
// SSIM = l s, l = (P - D + C1)/(P + D + C1), s = (V - W + C2)/(V + W + C2). Nothing cancels where
// the pictures agree: 1 - l = 2 D/(P + D + C1), dl/dP = 2 D/(P + D + C1)^2.
void evaluateSsim(const float* const statistics[4], const float* weights, size_t count,
                  float* errors, float* const maps[3]) {
  for (size_t i = 0; i < count; ++i) {
    float blurred[4];
    for (size_t s = 0; s < 4; ++s) {
      blurred[s] = blurredAt([&](size_t k) { return statistics[s][i + k]; });
    }
    const float mean_p = blurred[0];
    const float mean_d = blurred[1];
    const float p = 0.5f * mean_p * mean_p;
    const float d = 0.5f * mean_d * mean_d;
    // Rounding may leave a variance of 0 slightly negative; at 0 or more, SSIM stays within -1..1.
    const float v = std::max(0.0f, 0.5f * blurred[2] - p);
    const float w = std::max(0.0f, 0.5f * blurred[3] - d);
    const float inverse_1 = 1.0f / (p + d + kSsimC1);
    const float inverse_2 = 1.0f / (v + w + kSsimC2);
    const float l = (p - d + kSsimC1) * inverse_1;
    const float s = (v - w + kSsimC2) * inverse_2;
    errors[i] = 2 * d * inverse_1 + l * (2 * w * inverse_2);
    if (!maps[0]) continue;
    const float weight = weights ? weights[i] : 1.0f;
    const float by_l = 2 * weight * s * inverse_1 * inverse_1;
    const float by_s = 2 * weight * l * inverse_2 * inverse_2;
    const float by_v = by_s * w;
    const float by_w = -by_s * (v + kSsimC2);
    maps[0][i] = mean_p * (by_l * d - by_v) + mean_d * (-by_l * (p + kSsimC1) - by_w);
    maps[1][i] = by_v;
    maps[2][i] = by_w;
  }
}

void blurColumns(const float* const* rows, size_t count, float* const* out) {
  for (size_t row = 0; row < kBlockRows; ++row) {
    for (size_t i = 0; i < count; ++i) {
      out[row][i] = blurredAt([&](size_t k) { return rows[row + k][i]; });
    }
  }
}

void combineGradient(const float* const blurred_maps[3], const float* sums,
                     const float* differences, const float* weights, size_t count, float l1_scale,
                     float ssim_scale, float* out) {
  for (size_t i = 0; i < count; ++i) {
    float maps[3];
    for (size_t m = 0; m < 3; ++m) {
      maps[m] = blurredAt([&](size_t k) { return blurred_maps[m][i + k]; });
    }
    const float d = differences[i];
    const float sign = d > 0 ? 1.0f : d < 0 ? -1.0f : 0.0f;
    const float ssim = maps[0] + sums[i] * maps[1] + d * maps[2];
    out[i] = l1_scale * (weights ? weights[i] : 1.0f) * sign - ssim_scale * ssim;
  }
}

void writePixels(const float* const rows[3], size_t count, PixelRun<float> out) {
  for (size_t i = 0; i < count; ++i) {
    for (size_t c = 0; c < 3; ++c) *channelOf(out, i, c) = rows[c][i];
    if (out.layout == PixelLayout::kRgba) *channelOf(out, i, 3) = 0;
  }
}

double sumMagnitudes(const float* values, const float* weights, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    const double magnitude = std::abs(static_cast<double>(values[i]));
    sum += weights ? magnitude * static_cast<double>(weights[i]) : magnitude;
  }
  return sum;
}

}  // namespace

LossKernel scalarLossKernel() {
  return {"scalar",    readPixels,      blurStatistics, evaluateSsim,
          blurColumns, combineGradient, writePixels,    sumMagnitudes};
}

}  // namespace stipple
