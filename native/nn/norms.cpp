#include "nn/norms.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"

namespace stipple {

namespace {

/// Numbers of a piece of rows that a task takes.
constexpr size_t kGrain = 1 << 14;
/// Sums beside each other, in double: compilers make vectors of them, and every processor adds in
/// the same order.
constexpr size_t kSums = 8;

/// The sum over i of term(i).
template <class Term>
double sumOf(size_t count, const Term& term) {
  std::array<double, kSums> sums{};
  size_t i = 0;
  for (; i + kSums <= count; i += kSums) {
    for (size_t k = 0; k < kSums; ++k) sums[k] += term(i + k);
  }
  for (size_t k = 0; i < count; ++i, ++k) sums[k] += term(i);
  double sum = 0.0;
  for (const double part : sums) sum += part;
  return sum;
}

}  // namespace

void layerNorm(const LayerNorm& norm, size_t rows, const float* in, float* out) {
  const size_t width = norm.width;
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* from = in + row * width;
      float* to = out + row * width;
      const double mean = sumOf(width, [&](size_t i) { return static_cast<double>(from[i]); }) /
                          static_cast<double>(width);
      const double squares = sumOf(width, [&](size_t i) {
        const double offset = static_cast<double>(from[i]) - mean;
        return offset * offset;
      });
      const double factor =
          1.0 / std::sqrt(squares / static_cast<double>(width) + static_cast<double>(norm.epsilon));
      const auto centre = static_cast<float>(mean);
      const auto rate = static_cast<float>(factor);
      for (size_t i = 0; i < width; ++i) to[i] = (from[i] - centre) * rate;
      if (!norm.weight.empty()) {
        for (size_t i = 0; i < width; ++i) to[i] *= norm.weight[i];
      }
      if (!norm.bias.empty()) {
        for (size_t i = 0; i < width; ++i) to[i] += norm.bias[i];
      }
      if (!norm.scale.empty()) {
        for (size_t i = 0; i < width; ++i) to[i] *= 1.0f + norm.scale[i];
      }
      if (!norm.shift.empty()) {
        for (size_t i = 0; i < width; ++i) to[i] += norm.shift[i];
      }
    }
  });
}

void rmsNormHeads(size_t rows, size_t heads, size_t head_width, std::span<const float> gamma,
                  float* values, size_t row_stride) {
  const size_t grain = 1 + kGrain / std::max<size_t>(heads * head_width, 1);
  const double root = std::sqrt(static_cast<double>(head_width));
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t i = begin * heads; i < end * heads; ++i) {
      const size_t head = i % heads;
      float* head_values = values + i / heads * row_stride + head * head_width;
      const double squares = sumOf(head_width, [&](size_t k) {
        const double value = static_cast<double>(head_values[k]);
        return value * value;
      });
      const auto factor = static_cast<float>(root / std::max(std::sqrt(squares), 1e-12));
      for (size_t k = 0; k < head_width; ++k) {
        head_values[k] = head_values[k] * factor * gamma[head * head_width + k];
      }
    }
  });
}

}  // namespace stipple
