// Based on: Nam et al., Generative Densification, CVPR 2025, and its released code: up-sampling and
// learned masks. Differs: selection is by (score, index).
#include "decode/detail/detail_layer.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.h"
#include "decode/detail/detail_block.h"
#include "nn/activations.h"
#include "nn/norms.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

constexpr size_t kEncoded = 6 * kOffsetFrequencies;
constexpr size_t kGrain = 256;

LayerNorm plainNorm(size_t width) {
  return {width, kDetailEpsilon, {}, {}, {}, {}};
}

}  // namespace

PointUpsampling::PointUpsampling(ParameterLayout& layout, const std::string& prefix,
                                 size_t channels, size_t next_channels, size_t children)
    : channels_(channels),
      next_(next_channels),
      children_(children),
      offset_(layout, prefix + "delta_x.0", prefix + "delta_x.2",
              {channels, channels, 3 * children}, Activation::kGeluErf),
      skip_(layout, prefix + "skip", channels, next_channels),
      child_(layout, prefix + "delta_f.1", prefix + "delta_f.3",
             {kEncoded + channels, channels, next_channels}, Activation::kGeluErf) {}

PointUpsampling::Children PointUpsampling::apply(std::span<const float> values,
                                                 std::span<const float> points,
                                                 const std::vector<float>& f, double side,
                                                 Tape& tape) const {
  const size_t count = f.size() / channels_, rows = count * children_;
  const size_t width = kEncoded + channels_;
  tape.normal.resize(f.size());
  layerNorm(plainNorm(channels_), count, f.data(), tape.normal.data());
  tape.raw.resize(rows * 3);
  offset_.apply(values, count, tape.normal.data(), tape.offset_mlp, tape.raw.data());
  Children made;
  made.points.resize(rows * 3);
  tape.encoded.resize(rows * width);
  parallelFor(rows, kGrain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const size_t point = row / children_;
      float* to = &tape.encoded[row * width];
      for (size_t axis = 0; axis < 3; ++axis) {
        const double offset = 0.5 * side * std::tanh(static_cast<double>(tape.raw[row * 3 + axis]));
        made.points[row * 3 + axis] =
            static_cast<float>(static_cast<double>(points[point * 3 + axis]) + offset);
        for (size_t k = 0; k < kOffsetFrequencies; ++k) {
          const double angle = std::ldexp(offset, static_cast<int>(k));
          to[3 * k + axis] = static_cast<float>(std::sin(angle));
          to[3 * (kOffsetFrequencies + k) + axis] = static_cast<float>(std::cos(angle));
        }
      }
      std::copy_n(&tape.normal[point * channels_], channels_, to + kEncoded);
    }
  });
  tape.encoded_normal.resize(tape.encoded.size());
  layerNorm(plainNorm(width), rows, tape.encoded.data(), tape.encoded_normal.data());
  tape.sums.resize(rows * next_);
  child_.apply(values, rows, tape.encoded_normal.data(), tape.child_mlp, tape.sums.data());
  std::vector<float> kept(count * next_);
  skip_.apply(values, count, tape.normal.data(), kept.data());
  for (size_t i = 0; i < tape.sums.size(); ++i) {
    tape.sums[i] += kept[i / next_ / children_ * next_ + i % next_];
  }
  made.features.resize(tape.sums.size());
  layerNorm(plainNorm(next_), rows, tape.sums.data(), made.features.data());
  return made;
}

void PointUpsampling::backward(std::span<const float> values, const std::vector<float>& f,
                               double side, const Tape& tape, const Children& by,
                               std::span<float> gradients, std::span<float> by_points,
                               std::vector<float>& by_f) const {
  const size_t count = f.size() / channels_, rows = count * children_;
  const size_t width = kEncoded + channels_;
  std::vector<float> by_sums(rows * next_, 0.0f), by_kept(count * next_, 0.0f);
  layerNormBackward(plainNorm(next_), rows, tape.sums.data(), by.features.data(), {},
                    by_sums.data());
  for (size_t i = 0; i < by_sums.size(); ++i) {
    by_kept[i / next_ / children_ * next_ + i % next_] += by_sums[i];
  }
  std::vector<float> by_normal(count * channels_), by_encoded_normal(rows * width);
  skip_.backward(values, count, tape.normal.data(), by_kept.data(), gradients, by_normal.data());
  child_.backward(values, rows, tape.encoded_normal.data(), tape.child_mlp, by_sums.data(),
                  gradients, by_encoded_normal.data());
  std::vector<float> by_encoded(rows * width, 0.0f), by_raw(rows * 3);
  layerNormBackward(plainNorm(width), rows, tape.encoded.data(), by_encoded_normal.data(), {},
                    by_encoded.data());
  for (size_t row = 0; row < rows; ++row) {
    const size_t point = row / children_;
    const float* from = &tape.encoded[row * width];
    const float* outer = &by_encoded[row * width];
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto of_point = static_cast<double>(by.points[row * 3 + axis]);
      double by_offset = of_point;
      for (size_t k = 0; k < kOffsetFrequencies; ++k) {
        const size_t sine = 3 * k + axis, cosine = 3 * (kOffsetFrequencies + k) + axis;
        const double turned = static_cast<double>(outer[sine]) * static_cast<double>(from[cosine]) -
                              static_cast<double>(outer[cosine]) * static_cast<double>(from[sine]);
        by_offset += std::ldexp(turned, static_cast<int>(k));
      }
      const double tangent = std::tanh(static_cast<double>(tape.raw[row * 3 + axis]));
      by_raw[row * 3 + axis] = static_cast<float>(by_offset * 0.5 * side * (1 - tangent * tangent));
      by_points[point * 3 + axis] += static_cast<float>(of_point);
    }
    for (size_t i = 0; i < channels_; ++i) {
      by_normal[point * channels_ + i] += outer[kEncoded + i];
    }
  }
  std::vector<float> more(count * channels_);
  offset_.backward(values, count, tape.normal.data(), tape.offset_mlp, by_raw.data(), gradients,
                   more.data());
  addScaled(count, channels_, {}, more.data(), by_normal.data());
  by_f.assign(f.size(), 0.0f);
  layerNormBackward(plainNorm(channels_), count, f.data(), by_normal.data(), {}, by_f.data());
}

PointSelection::PointSelection(ParameterLayout& layout, const std::string& prefix, size_t channels,
                               DetailScore score)
    : channels_(channels),
      net_(layout, prefix + "net.0", prefix + "net.2", {channels, channels, 1},
           Activation::kGeluErf),
      score_(score) {}

std::vector<uint8_t> PointSelection::choose(std::span<const float> values,
                                            const std::vector<float>& f, double ratio,
                                            Tape& tape) const {
  const size_t count = f.size() / channels_;
  std::vector<float> logits(count);
  net_.apply(values, count, f.data(), tape.mlp, logits.data());
  tape.probabilities.resize(count);
  if (score_ == DetailScore::kLogistic) {
    for (size_t i = 0; i < count; ++i) {
      tape.probabilities[i] =
          static_cast<float>(1 / (1 + std::exp(-static_cast<double>(logits[i]))));
    }
  } else {
    const float peak = *std::max_element(logits.begin(), logits.end());
    double sum = 0;
    for (const float logit : logits) sum += std::exp(static_cast<double>(logit - peak));
    for (size_t i = 0; i < count; ++i) {
      tape.probabilities[i] =
          static_cast<float>(std::exp(static_cast<double>(logits[i] - peak)) / sum);
    }
  }
  return largestShare(logits, ratio);
}

void PointSelection::backward(std::span<const float> values, const std::vector<float>& f,
                              const Tape& tape, const std::vector<float>& by_handed,
                              std::span<float> gradients, std::vector<float>& by_f) const {
  const size_t count = f.size() / channels_;
  std::vector<double> by_probability(count, 0.0);
  double mean = 0;  // of the derivatives, by the probabilities
  for (size_t row = 0; row < count; ++row) {
    for (size_t i = row * channels_; i < (row + 1) * channels_; ++i) {
      by_probability[row] += static_cast<double>(f[i]) * static_cast<double>(by_handed[i]);
      by_f[i] += tape.probabilities[row] * by_handed[i];
    }
    mean += by_probability[row] * static_cast<double>(tape.probabilities[row]);
  }
  std::vector<float> by_logits(count), more(f.size());
  for (size_t row = 0; row < count; ++row) {
    const auto p = static_cast<double>(tape.probabilities[row]);
    by_logits[row] =
        static_cast<float>(score_ == DetailScore::kLogistic ? p * (1 - p) * by_probability[row]
                                                            : p * (by_probability[row] - mean));
  }
  net_.backward(values, count, f.data(), tape.mlp, by_logits.data(), gradients, more.data());
  addScaled(count, channels_, {}, more.data(), by_f.data());
}

std::vector<uint8_t> largestShare(std::span<const float> values, double ratio) {
  std::vector<uint32_t> order(values.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return values[a] > values[b]; });
  const auto count = std::min(
      values.size(), static_cast<size_t>(std::ceil(ratio * static_cast<double>(values.size()))));
  std::vector<uint8_t> goes_on(values.size(), 0);
  for (size_t i = 0; i < count; ++i) goes_on[order[i]] = 1;
  return goes_on;
}

}  // namespace stipple
