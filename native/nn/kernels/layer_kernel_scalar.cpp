#include <algorithm>
#include <bit>
#include <cmath>

#include "nn/kernels/layer_kernel.h"

namespace stipple {

namespace {

constexpr double kRootTwoOverPi = 0.79788456080286536;
constexpr double kRootHalf = 0.70710678118654752;
constexpr double kDensityAtZero = 0.39894228040143268;  // of the normal distribution

/// In double, so that each is right to the last bit of float32 or two.
double activated(Activation activation, double x) {
  switch (activation) {
    case Activation::kSilu:
      return x / (1.0 + std::exp(-x));
    case Activation::kRelu:
      return x > 0.0 ? x : 0.0;
    case Activation::kGeluTanh:
      return 0.5 * x * (1.0 + std::tanh(kRootTwoOverPi * (x + 0.044715 * x * x * x)));
    case Activation::kGeluErf:
      return 0.5 * x * std::erfc(-kRootHalf * x);
  }
  return x;
}

void activateScalar(Activation activation, size_t count, float* values) {
  for (size_t i = 0; i < count; ++i) {
    values[i] = static_cast<float>(activated(activation, static_cast<double>(values[i])));
  }
}

double slopeOf(Activation activation, double x) {
  switch (activation) {
    case Activation::kSilu: {
      const double logistic = 1.0 / (1.0 + std::exp(-x));
      return logistic * (1.0 + x * (1.0 - logistic));
    }
    case Activation::kRelu:
      return x > 0.0 ? 1.0 : 0.0;
    case Activation::kGeluTanh: {
      const double held = std::clamp(x, -30.0, 30.0);  // Beyond, the slope is 0 or 1.
      const double t = std::tanh(kRootTwoOverPi * (held + 0.044715 * held * held * held));
      const double inner = kRootTwoOverPi * (1.0 + 3.0 * 0.044715 * held * held);
      return 0.5 * (1.0 + t) + 0.5 * held * (1.0 - t * t) * inner;
    }
    case Activation::kGeluErf:
      return 0.5 * std::erfc(-kRootHalf * x) + x * kDensityAtZero * std::exp(-0.5 * x * x);
  }
  return 1.0;
}

void scaleBySlopeScalar(Activation activation, size_t count, const float* in, float* gradient) {
  for (size_t i = 0; i < count; ++i) {
    gradient[i] *= static_cast<float>(slopeOf(activation, static_cast<double>(in[i])));
  }
}

void siluGateScalar(size_t count, const float* gate, const float* up, float* out) {
  for (size_t i = 0; i < count; ++i) {
    const double silu = activated(Activation::kSilu, static_cast<double>(gate[i]));
    out[i] = static_cast<float>(silu * static_cast<double>(up[i]));
  }
}

void narrowScalar(size_t count, const float* from, uint16_t* to) {
  for (size_t i = 0; i < count; ++i) {
    const auto bits = std::bit_cast<uint32_t>(from[i]);
    to[i] = static_cast<uint16_t>((bits + 0x7fffu + ((bits >> 16) & 1u)) >> 16);
  }
}

void softmaxScalar(SoftmaxRow& row) {
  float peak = row.peak;
  for (size_t i = 0; i < row.keys; ++i) {
    const float bias = row.key_bias == nullptr ? 0.0f : row.key_bias[i];
    row.scores[i] = row.scale * row.scores[i] + bias;
    peak = std::max(peak, row.scores[i]);
  }
  float sum = 0.0f;
  for (size_t i = 0; i < row.keys; ++i) {
    row.scores[i] = std::exp(row.scores[i] - peak);
    sum += row.scores[i];
  }
  if (row.narrow != nullptr) narrowScalar(row.keys, row.scores, row.narrow);
  const float shrink = std::exp(row.peak - peak);
  row.peak = peak;
  row.sum = row.sum * shrink + sum;
  for (size_t i = 0; i < row.width; ++i) row.out[i] *= shrink;
}

void softmaxColumnsScalar(const SoftmaxColumns& tile) {
  for (size_t column = 0; column < tile.columns; ++column) {
    float peak = tile.peaks[column];
    for (size_t i = 0; i < tile.keys; ++i) {
      peak = std::max(peak, tile.rates[i] * tile.scores[i * tile.columns + column]);
    }
    float sum = 0.0f;
    for (size_t i = 0; i < tile.keys; ++i) {
      float& score = tile.scores[i * tile.columns + column];
      score = std::exp(tile.rates[i] * score - peak);
      sum += score;
    }
    const float shrink = std::exp(tile.peaks[column] - peak);
    tile.peaks[column] = peak;
    tile.sums[column] = tile.sums[column] * shrink + sum;
    for (size_t i = 0; i < tile.width; ++i) tile.out[i * tile.columns + column] *= shrink;
  }
}

void widenScalar(WeightType type, size_t count, const uint8_t* bytes, float* to) {
  widen({type, "", {}, bytes}, 0, {to, count});
}

}  // namespace

LayerKernel scalarLayerKernel() {
  return {"scalar",      activateScalar,       scaleBySlopeScalar, siluGateScalar,
          softmaxScalar, softmaxColumnsScalar, narrowScalar,       widenScalar};
}

}  // namespace stipple
