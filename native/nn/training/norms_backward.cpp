#include "nn/training/norms_backward.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "nn/training/column_sums.h"

namespace stipple {

namespace {

/// Numbers of a piece of rows that a task takes.
constexpr size_t kGrain = 1 << 14;

double doubleAt(const float* values, size_t i) {
  return static_cast<double>(values[i]);
}
double doubleAt(std::span<const float> values, size_t i) {
  return static_cast<double>(values[i]);
}

/// (in - mean) * rate is what a row becomes before weights.
struct RowStatistics {
  double mean = 0, rate = 0;
};

RowStatistics statisticsOf(size_t width, double epsilon, const float* in) {
  double sum = 0, squares = 0;
  for (size_t i = 0; i < width; ++i) sum += doubleAt(in, i);
  const double mean = sum / static_cast<double>(width);
  for (size_t i = 0; i < width; ++i) {
    const double offset = doubleAt(in, i) - mean;
    squares += offset * offset;
  }
  return {mean, 1.0 / std::sqrt(squares / static_cast<double>(width) + epsilon)};
}

/// Weight times 1 + scale of a column.
double factorAt(const LayerNorm& norm, size_t i) {
  const double weight = norm.weight.empty() ? 1.0 : doubleAt(norm.weight, i);
  return weight * (norm.scale.empty() ? 1.0 : 1.0 + doubleAt(norm.scale, i));
}

/// With n the normalised number and y = n weight + bias, the result is y (1 + scale) + shift.
void addParameterGradients(const LayerNorm& norm, size_t rows, const float* in,
                           const float* out_gradient, std::span<const RowStatistics> statistics,
                           const LayerNormGradients& gradients) {
  const size_t width = norm.width;
  const auto add = [&](float* sums, const auto& term) {
    if (sums == nullptr) return;
    addColumnSums(
        rows, width,
        [&](size_t row, double* part) {
          const RowStatistics& of = statistics[row];
          for (size_t i = 0; i < width; ++i) {
            const double normal = (doubleAt(in, row * width + i) - of.mean) * of.rate;
            part[i] += term(i, normal) * doubleAt(out_gradient, row * width + i);
          }
        },
        sums);
  };
  const auto scaled = [&](size_t i) {
    return norm.scale.empty() ? 1.0 : 1.0 + doubleAt(norm.scale, i);
  };
  const auto affine = [&](size_t i, double normal) {
    const double weighted = norm.weight.empty() ? normal : normal * doubleAt(norm.weight, i);
    return norm.bias.empty() ? weighted : weighted + doubleAt(norm.bias, i);
  };
  add(gradients.weight, [&](size_t i, double normal) { return scaled(i) * normal; });
  add(gradients.bias, [&](size_t i, double) { return scaled(i); });
  add(gradients.scale, affine);
  add(gradients.shift, [](size_t, double) { return 1.0; });
}

}  // namespace

void layerNormBackward(const LayerNorm& norm, size_t rows, const float* in,
                       const float* out_gradient, const LayerNormGradients& gradients,
                       float* in_gradient) {
  const size_t width = norm.width;
  std::vector<RowStatistics> statistics(rows);
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      const float* from = in + row * width;
      const float* outer = out_gradient + row * width;
      const RowStatistics of = statisticsOf(width, static_cast<double>(norm.epsilon), from);
      statistics[row] = of;
      double mean = 0, product = 0;
      for (size_t i = 0; i < width; ++i) {
        const double inner = doubleAt(outer, i) * factorAt(norm, i);
        mean += inner;
        product += inner * (doubleAt(from, i) - of.mean) * of.rate;
      }
      mean /= static_cast<double>(width);
      product /= static_cast<double>(width);
      for (size_t i = 0; i < width; ++i) {
        const double normal = (doubleAt(from, i) - of.mean) * of.rate;
        const double inner = doubleAt(outer, i) * factorAt(norm, i);
        in_gradient[row * width + i] +=
            static_cast<float>(of.rate * (inner - mean - normal * product));
      }
    }
  });
  addParameterGradients(norm, rows, in, out_gradient, statistics, gradients);
}

void rmsNormHeadsBackward(size_t rows, size_t heads, size_t head_width,
                          std::span<const float> gamma, const float* in, size_t in_stride,
                          float* gradient, size_t gradient_stride, float* gamma_gradient) {
  constexpr double kShortest = 1e-12;
  const size_t width = heads * head_width;
  const double root = std::sqrt(static_cast<double>(head_width));
  std::vector<double> lengths(rows * heads);
  addColumnSums(
      rows, width,
      [&](size_t row, double* part) {
        for (size_t head = 0; head < heads; ++head) {
          const float* values = in + row * in_stride + head * head_width;
          const float* outer = gradient + row * gradient_stride + head * head_width;
          double squares = 0;
          for (size_t i = 0; i < head_width; ++i)
            squares += doubleAt(values, i) * doubleAt(values, i);
          const double length = std::max(std::sqrt(squares), kShortest);
          lengths[row * heads + head] = length;
          for (size_t i = 0; i < head_width; ++i) {
            part[head * head_width + i] += doubleAt(outer, i) * doubleAt(values, i) * root / length;
          }
        }
      },
      gamma_gradient);
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows * heads, grain * heads, [&](size_t begin, size_t end) {
    for (size_t at = begin; at < end; ++at) {
      const size_t row = at / heads, head = at % heads;
      const float* values = in + row * in_stride + head * head_width;
      float* outer = gradient + row * gradient_stride + head * head_width;
      const std::span<const float> factors = gamma.subspan(head * head_width, head_width);
      const double length = lengths[at];
      double along = 0;
      for (size_t i = 0; i < head_width && length > kShortest; ++i) {
        along += doubleAt(outer, i) * doubleAt(factors, i) * doubleAt(values, i);
      }
      along /= length * length;
      for (size_t i = 0; i < head_width; ++i) {
        const double inner = doubleAt(outer, i) * doubleAt(factors, i);
        outer[i] = static_cast<float>(root / length * (inner - along * doubleAt(values, i)));
      }
    }
  });
}

void addScaledBackward(size_t rows, size_t width, std::span<const float> factor, const float* y,
                       const float* x_gradient, float* y_gradient, float* factor_gradient) {
  const size_t grain = 1 + kGrain / std::max<size_t>(width, 1);
  parallelFor(rows, grain, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      for (size_t i = 0; i < width; ++i) {
        y_gradient[row * width + i] = factor[i] * x_gradient[row * width + i];
      }
    }
  });
  addColumnSums(
      rows, width,
      [&](size_t row, double* part) {
        for (size_t i = 0; i < width; ++i) {
          part[i] += doubleAt(y, row * width + i) * doubleAt(x_gradient, row * width + i);
        }
      },
      factor_gradient);
}

}  // namespace stipple
