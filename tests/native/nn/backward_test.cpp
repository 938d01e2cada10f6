#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "activated_by_hand.h"
#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/training/attention_backward.h"
#include "nn/training/norms_backward.h"
#include "nn/training/trained_linear.h"
#include "test_numbers.h"

namespace stipple {
namespace {

// Derivatives are judged by central differences of formulas in double. Steps of 1e-5 leave 1e-9 or
// so; what is allowed is for the float32 of the derivatives, a few sums of some hundred terms.
constexpr double kStep = 1e-5;
constexpr double kShareOfLargest = 1e-5;

using Numbers = std::vector<double>;

Numbers widened(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

/// The sum of all results times weights, so that each result has a derivative of its own.
double weighed(const Numbers& results, const std::vector<float>& weights) {
  double sum = 0;
  for (size_t i = 0; i < results.size(); ++i) sum += results[i] * static_cast<double>(weights[i]);
  return sum;
}

void expectDerivative(const std::function<double(const Numbers&)>& loss, const Numbers& at,
                      const std::vector<float>& seen, const char* what) {
  ASSERT_EQ(at.size(), seen.size()) << what;
  Numbers expected(at.size());
  double largest = 0;
  for (size_t i = 0; i < at.size(); ++i) {
    Numbers before = at, after = at;
    before[i] -= kStep;
    after[i] += kStep;
    expected[i] = (loss(after) - loss(before)) / (2 * kStep);
    largest = std::max(largest, std::abs(expected[i]));
  }
  EXPECT_GT(largest, 0.0) << what;
  for (size_t i = 0; i < at.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(seen[i]), expected[i], kShareOfLargest * largest + 1e-8)
        << what << " " << i;
  }
}

TEST(Backward, SlopesOfActivationsByEveryKernel) {
  std::vector<float> x;
  for (int i = -50001; i <= 50001; i += 2) x.push_back(static_cast<float>(i) * 2.5e-4f);
  for (const LayerKernel& kernel : layerKernels()) {
    for (const Activation activation : kActivations) {
      std::vector<float> slope(x.size(), 1.0f);
      kernel.scaleBySlope(activation, x.size(), x.data(), slope.data());
      for (size_t i = 0; i < x.size(); ++i) {
        const auto at = static_cast<double>(x[i]);
        const double expected =
            (activatedByHand(activation, at + kStep) - activatedByHand(activation, at - kStep)) /
            (2 * kStep);
        // What nn/activations.h says.
        ASSERT_NEAR(static_cast<double>(slope[i]), expected, 2e-6)
            << kernel.target << " " << static_cast<int>(activation) << " at " << x[i];
      }
    }
  }
}

TEST(Backward, SlopesFarOutAreZeroOrOne) {
  const std::vector<float> x = {100.0f, 1e6f, 1e18f, -100.0f, -1e6f, -1e18f};
  for (const LayerKernel& kernel : layerKernels()) {
    for (const Activation activation : kActivations) {
      std::vector<float> slope(x.size(), 3.0f);
      kernel.scaleBySlope(activation, x.size(), x.data(), slope.data());
      for (size_t i = 0; i < x.size(); ++i) {
        EXPECT_NEAR(slope[i], x[i] > 0 ? 3.0f : 0.0f, 1e-6f)
            << kernel.target << " " << static_cast<int>(activation) << " at " << x[i];
      }
    }
  }
}

TEST(Backward, Linear) {
  constexpr size_t kRows = 5, kInputs = 7, kOutputs = 9;
  ParameterLayout layout;
  layout.add("before", {3});
  const TrainedLinear linear(layout, "layer", kInputs, kOutputs);
  const std::vector<float> values = numbers(layout.size(), 1), in = numbers(kRows * kInputs, 2);
  const std::vector<float> weights = numbers(kRows * kOutputs, 3);
  const auto loss = [&](const Numbers& of_layer, const Numbers& of_rows) {
    Numbers out;
    for (size_t row = 0; row < kRows; ++row) {
      for (size_t o = 0; o < kOutputs; ++o) {
        double sum = of_layer[3 + kOutputs * kInputs + o];
        for (size_t i = 0; i < kInputs; ++i) {
          sum += of_layer[3 + o * kInputs + i] * of_rows[row * kInputs + i];
        }
        out.push_back(sum);
      }
    }
    return weighed(out, weights);
  };
  std::vector<float> out(kRows * kOutputs), gradients(layout.size(), 1.0f);
  std::vector<float> by_in(in.size(), 99.0f);
  linear.apply(values, kRows, in.data(), out.data());
  EXPECT_NEAR(weighed(widened(out), weights), loss(widened(values), widened(in)), 1e-5);
  linear.backward(values, kRows, in.data(), weights.data(), gradients, by_in.data());
  for (float& value : gradients) value -= 1.0f;  // They are added to.
  expectDerivative([&](const Numbers& at) { return loss(at, widened(in)); }, widened(values),
                   gradients, "weights");
  expectDerivative([&](const Numbers& at) { return loss(widened(values), at); }, widened(in), by_in,
                   "in");
}

TEST(Backward, LayerNormWithWeightsAndModulation) {
  constexpr size_t kRows = 70, kWidth = 6;  // More than one block of sums.
  const std::vector<float> in = numbers(kRows * kWidth, 1), outer = numbers(kRows * kWidth, 2);
  const std::vector<float> all = numbers(4 * kWidth, 3);  // weight, bias, scale, shift
  const std::span<const float> parts = all;
  const auto loss = [&](const Numbers& of_rows, const Numbers& of_norm) {
    Numbers out;
    for (size_t row = 0; row < kRows; ++row) {
      double mean = 0, squares = 0;
      for (size_t i = 0; i < kWidth; ++i) mean += of_rows[row * kWidth + i] / kWidth;
      for (size_t i = 0; i < kWidth; ++i) {
        squares += std::pow(of_rows[row * kWidth + i] - mean, 2) / kWidth;
      }
      for (size_t i = 0; i < kWidth; ++i) {
        const double normal = (of_rows[row * kWidth + i] - mean) / std::sqrt(squares + 1e-3);
        out.push_back((normal * of_norm[i] + of_norm[kWidth + i]) * (1 + of_norm[2 * kWidth + i]) +
                      of_norm[3 * kWidth + i]);
      }
    }
    return weighed(out, outer);
  };
  const LayerNorm norm = {kWidth,
                          1e-3f,
                          parts.subspan(0, kWidth),
                          parts.subspan(kWidth, kWidth),
                          parts.subspan(2 * kWidth, kWidth),
                          parts.subspan(3 * kWidth, kWidth)};
  std::vector<float> by_in(in.size(), 0.0f), by_norm(all.size(), 0.0f);
  layerNormBackward(norm, kRows, in.data(), outer.data(),
                    {&by_norm[0], &by_norm[kWidth], &by_norm[2 * kWidth], &by_norm[3 * kWidth]},
                    by_in.data());
  expectDerivative([&](const Numbers& at) { return loss(at, widened(all)); }, widened(in), by_in,
                   "in");
  expectDerivative([&](const Numbers& at) { return loss(widened(in), at); }, widened(all), by_norm,
                   "weight, bias, scale, shift");
}

TEST(Backward, NormsOfHeads) {
  constexpr size_t kRows = 5, kHeads = 2, kWidth = 3, kStride = 8;
  std::vector<float> in = numbers(kRows * kStride, 1);
  const std::vector<float> outer = numbers(kRows * kStride, 2), gamma = numbers(6, 3);
  const auto loss = [&](const Numbers& of_rows, const Numbers& of_gamma) {
    double sum = 0;
    for (size_t row = 0; row < kRows; ++row) {
      for (size_t head = 0; head < kHeads; ++head) {
        const double* values = &of_rows[row * kStride + head * kWidth];
        const double length = std::hypot(values[0], values[1], values[2]);
        for (size_t i = 0; i < kWidth; ++i) {
          sum += static_cast<double>(outer[row * kStride + head * kWidth + i]) * values[i] *
                 of_gamma[head * kWidth + i] * std::sqrt(3.0) / length;
        }
      }
    }
    return sum;
  };
  std::vector<float> gradient = outer, by_gamma(gamma.size(), 0.0f);
  rmsNormHeadsBackward(kRows, kHeads, kWidth, gamma, in.data(), kStride, gradient.data(), kStride,
                       by_gamma.data());
  for (size_t i = 0; i < gradient.size(); ++i) {
    if (i % kStride < kHeads * kWidth) continue;
    EXPECT_EQ(gradient[i], outer[i]) << "what lies between rows";
    gradient[i] = 0;
  }
  expectDerivative([&](const Numbers& at) { return loss(at, widened(gamma)); }, widened(in),
                   gradient, "in");
  expectDerivative([&](const Numbers& at) { return loss(widened(in), at); }, widened(gamma),
                   by_gamma, "gamma");
  // A head of zeros has a direction of no length, and a derivative that is finite.
  std::vector<float> zeros(6, 0.0f), outwards(6, 1e-6f), of_gamma(6, 0.0f);
  rmsNormHeadsBackward(1, kHeads, kWidth, gamma, zeros.data(), 6, outwards.data(), 6,
                       of_gamma.data());
  for (const float value : outwards) EXPECT_TRUE(std::isfinite(value));
}

/// A matrix of heads for tests: rows with room between them.
struct Heads {
  size_t stride;
  std::vector<float> values;
  HeadRows rows() const { return {values.data(), stride}; }
};

TEST(Backward, Attention) {
  // More queries than a tile, keys that are no multiple of a vector.
  for (const AttentionShape shape : {AttentionShape{2, 4, 5, 7}, AttentionShape{1, 3, 131, 3}}) {
    const size_t width = shape.heads * shape.head_width;
    const Heads q = {width + 1, numbers(shape.queries * (width + 1), 1)};
    const Heads k = {width, numbers(shape.keys * width, 2)};
    const Heads v = {width + 2, numbers(shape.keys * (width + 2), 3)};
    const std::vector<float> outer = numbers(shape.queries * width, 4);
    const auto loss = [&](const Numbers& of_q, const Numbers& of_k, const Numbers& of_v) {
      double sum = 0;
      for (size_t head = 0; head < shape.heads; ++head) {
        for (size_t i = 0; i < shape.queries; ++i) {
          Numbers powers(shape.keys);
          double whole = 0;
          for (size_t j = 0; j < shape.keys; ++j) {
            double score = 0;
            for (size_t c = 0; c < shape.head_width; ++c) {
              const size_t at = head * shape.head_width + c;
              score += of_q[i * q.stride + at] * of_k[j * k.stride + at];
            }
            powers[j] = std::exp(score / std::sqrt(static_cast<double>(shape.head_width)));
            whole += powers[j];
          }
          for (size_t j = 0; j < shape.keys; ++j) {
            for (size_t c = 0; c < shape.head_width; ++c) {
              const size_t at = head * shape.head_width + c;
              sum += powers[j] / whole * of_v[j * v.stride + at] *
                     static_cast<double>(outer[i * width + at]);
            }
          }
        }
      }
      return sum;
    };
    std::vector<float> out(outer.size());
    attention({}, shape, q.rows(), k.rows(), v.rows(), out.data(), width);
    std::vector<float> by_q(q.values.size(), 0.0f), by_k(k.values.size(), 0.0f),
        by_v(v.values.size(), 0.0f);
    const auto backward = [&] {
      attentionBackward(shape, q.rows(), k.rows(), v.rows(), {out.data(), width},
                        {outer.data(), width}, {by_q.data(), q.stride}, {by_k.data(), k.stride},
                        {by_v.data(), v.stride});
    };
    backward();
    const Numbers all_q = widened(q.values), all_k = widened(k.values), all_v = widened(v.values);
    expectDerivative([&](const Numbers& at) { return loss(at, all_k, all_v); }, all_q, by_q, "q");
    expectDerivative([&](const Numbers& at) { return loss(all_q, at, all_v); }, all_k, by_k, "k");
    expectDerivative([&](const Numbers& at) { return loss(all_q, all_k, at); }, all_v, by_v, "v");
    const std::vector<float> first_q = by_q, first_k = by_k, first_v = by_v;
    withThreads(1, backward);
    EXPECT_EQ(first_q, by_q);
    EXPECT_EQ(first_k, by_k);
    EXPECT_EQ(first_v, by_v);
  }
}

TEST(Backward, Gates) {
  constexpr size_t kRows = 3, kWidth = 4;
  const std::vector<float> factor = numbers(kWidth, 1), y = numbers(kRows * kWidth, 2);
  const std::vector<float> outer = numbers(kRows * kWidth, 3);
  std::vector<float> by_y(y.size()), by_factor(kWidth, 0.0f);
  addScaledBackward(kRows, kWidth, factor, y.data(), outer.data(), by_y.data(), by_factor.data());
  const auto loss = [&](const Numbers& of_factor, const Numbers& of_y) {
    double sum = 0;
    for (size_t i = 0; i < of_y.size(); ++i) {
      sum += of_factor[i % kWidth] * of_y[i] * static_cast<double>(outer[i]);
    }
    return sum;
  };
  expectDerivative([&](const Numbers& at) { return loss(at, widened(y)); }, widened(factor),
                   by_factor, "factor");
  expectDerivative([&](const Numbers& at) { return loss(widened(factor), at); }, widened(y), by_y,
                   "y");
}

}  // namespace
}  // namespace stipple
