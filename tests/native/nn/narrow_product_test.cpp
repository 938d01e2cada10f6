#include "nn/training/narrow_product.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/matrix_backend.h"
#include "nn/training/trained_mlp.h"
#include "test_numbers.h"

namespace stipple {
namespace {

// More and fewer rows than a task and than a sum have, columns of more than a panel, odd sizes.
const NarrowLayer kLayers[] = {
    {1, 1, 1}, {64, 32, 48}, {137, 33, 300}, {700, 260, 7}, {600, 3, 65}};

bool hasNarrow() {
  return defaultMatrixBackend().has(FactorPrecision::kBfloat16);
}

/// To the nearest bfloat16, of two as near the even one.
double rounded(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const uint32_t upper = (bits + 0x7fffu + (bits >> 16 & 1u)) & 0xffff0000u;
  return static_cast<double>(std::bit_cast<float>(upper));
}

double plain(float value) {
  return static_cast<double>(value);
}

struct Made {
  std::vector<float> out, weight_gradient, in_gradient;
  bool operator==(const Made&) const = default;
};

struct Numbers {
  explicit Numbers(const NarrowLayer& layer)
      : in(numbers(layer.rows * layer.inputs, 1)),
        weight(numbers(layer.inputs * layer.outputs, 2)),
        bias(numbers(layer.outputs, 3)),
        out_gradient(numbers(layer.rows * layer.outputs, 4)),
        before(numbers(layer.inputs * layer.outputs, 5)) {}
  std::vector<float> in, weight, bias, out_gradient, before;
};

Made madeOf(const NarrowLayer& layer, const Numbers& of) {
  Made made;
  made.out.resize(layer.rows * layer.outputs);
  made.in_gradient.resize(layer.rows * layer.inputs);
  made.weight_gradient = of.before;
  applyNarrow(layer, of.in.data(), of.weight.data(), of.bias.data(), made.out.data());
  backwardNarrow(layer, of.in.data(), of.weight.data(), of.out_gradient.data(),
                 made.weight_gradient.data(), made.in_gradient.data());
  return made;
}

/// The same sums in double, with factors as `factor` makes them.
template <class Factor>
Made expectedOf(const NarrowLayer& layer, const Numbers& of, const Factor& factor) {
  std::vector<double> out(of.bias.size() * layer.rows),
      by_weight(of.before.begin(), of.before.end()), by_in(of.in.size());
  for (size_t row = 0; row < layer.rows; ++row) {
    for (size_t o = 0; o < layer.outputs; ++o) {
      double& sum = out[row * layer.outputs + o];
      sum = plain(of.bias[o]);
      const double by = factor(of.out_gradient[row * layer.outputs + o]);
      for (size_t i = 0; i < layer.inputs; ++i) {
        const double in = factor(of.in[row * layer.inputs + i]);
        const double weight = factor(of.weight[o * layer.inputs + i]);
        sum += in * weight;
        by_weight[o * layer.inputs + i] += by * in;
        by_in[row * layer.inputs + i] += by * weight;
      }
    }
  }
  return {
      {out.begin(), out.end()}, {by_weight.begin(), by_weight.end()}, {by_in.begin(), by_in.end()}};
}

void expectNear(const std::vector<float>& seen, const std::vector<float>& expected, double allowed,
                const char* what) {
  ASSERT_EQ(seen.size(), expected.size()) << what;
  for (size_t i = 0; i < seen.size(); ++i) {
    ASSERT_NEAR(plain(seen[i]), plain(expected[i]), allowed) << what << " " << i;
  }
}

TEST(NarrowProduct, RoundsFactorsAndNothingElse) {
  if (!hasNarrow()) GTEST_SKIP() << "no products in bfloat16 here";
  for (const NarrowLayer& layer : kLayers) {
    const Numbers of(layer);
    const Made seen = madeOf(layer, of), expected = expectedOf(layer, of, rounded);
    // Sums of up to 700 terms in float32, of up to 10 or so, each rounded by half of 1e-6.
    expectNear(seen.out, expected.out, 5e-5, "out");
    expectNear(seen.weight_gradient, expected.weight_gradient, 5e-5, "by weights");
    expectNear(seen.in_gradient, expected.in_gradient, 5e-5, "by inputs");
  }
}

TEST(NarrowProduct, IsNearTheProductInFloat32) {
  if (!hasNarrow()) GTEST_SKIP() << "no products in bfloat16 here";
  for (const NarrowLayer& layer : kLayers) {
    const Numbers of(layer);
    const Made seen = madeOf(layer, of), expected = expectedOf(layer, of, plain);
    // A factor of 8 bits in -1..1 is off by 2^-10.2 in the root mean square (up to 2^-9), times the
    // other one, whose mean square is a third; each product has two of them. Six deviations.
    const auto off = [](size_t terms) {
      return 6 * std::sqrt(static_cast<double>(terms) * 2 / 3) * std::exp2(-10.2);
    };
    expectNear(seen.out, expected.out, off(layer.inputs), "out");
    expectNear(seen.weight_gradient, expected.weight_gradient, off(layer.rows), "by weights");
    expectNear(seen.in_gradient, expected.in_gradient, off(layer.outputs), "by inputs");
  }
}

TEST(NarrowProduct, HasTheSameBitsForAnyNumberOfThreads) {
  if (!hasNarrow()) GTEST_SKIP() << "no products in bfloat16 here";
  for (const NarrowLayer& layer : kLayers) {
    const Numbers of(layer);
    Made first;
    withThreads(1, [&] { first = madeOf(layer, of); });
    for (const size_t threads : {size_t{2}, size_t{3}}) {
      withThreads(threads, [&] { EXPECT_EQ(madeOf(layer, of), first) << threads; });
    }
  }
}

TEST(NarrowProduct, LayersOfALayoutTakeItsPrecision) {
  if (!hasNarrow()) {
    try {
      ParameterLayout layout(FactorPrecision::kBfloat16);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
    }
    GTEST_SKIP() << "no products in bfloat16 here";
  }
  const size_t rows = 70, inputs = 24, outputs = 40;
  const std::vector<float> in = numbers(rows * inputs, 1), by = numbers(rows * outputs, 2);
  std::vector<float> values, out[2], gradients[2], by_in[2];
  for (const bool is_narrow : {false, true}) {
    ParameterLayout layout(is_narrow ? FactorPrecision::kBfloat16 : FactorPrecision::kFloat32);
    const TrainedMlp mlp(layout, "a", "b", {inputs, 96, outputs}, Activation::kGeluTanh,
                         layout.precision());
    values = numbers(layout.size(), 3);
    TrainedMlp::Tape tape;
    out[is_narrow].resize(rows * outputs);
    gradients[is_narrow].resize(layout.size());
    by_in[is_narrow].resize(rows * inputs);
    mlp.apply(values, rows, in.data(), tape, out[is_narrow].data());
    mlp.backward(values, rows, in.data(), tape, by.data(), gradients[is_narrow],
                 by_in[is_narrow].data());
  }
  const auto difference = [](const std::vector<float>* of) {
    double squares = 0, all = 0;
    for (size_t i = 0; i < of[0].size(); ++i) {
      squares += std::pow(plain(of[0][i]) - plain(of[1][i]), 2);
      all += std::pow(plain(of[0][i]), 2);
    }
    return std::sqrt(squares / all);
  };
  // Two layers, each of which adds 2^-10.3 of its size: a few of 10^-3, and not nothing.
  for (const std::vector<float>* of : {out, gradients, by_in}) {
    EXPECT_GT(difference(of), 2e-4);
    EXPECT_LT(difference(of), 5e-3);
  }
}

}  // namespace
}  // namespace stipple
