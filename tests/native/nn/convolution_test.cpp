#include "nn/convolution.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/group_norm.h"
#include "nn/made_weights.h"
#include "nn/matrix_backend.h"

namespace stipple {
namespace {

using testing::HasSubstr;

struct Case {
  const char* name;
  ConvolutionGrid grid;
  size_t height, width, inputs, outputs;
};

FeatureMap randomMap(size_t height, size_t width, size_t channels, uint64_t seed) {
  FeatureMap map = FeatureMap::ofSize(height, width, channels);
  const std::vector<float> made = numbers(map.values.size(), seed);
  std::copy(made.begin(), made.end(), map.values.begin());
  return map;
}

MadeWeights weightsOf(const Case& c) {
  MadeWeights weights;
  weights.addLayer("layer", {c.outputs, c.inputs, c.grid.kernel, c.grid.kernel});
  return weights;
}

/// A sum in double and the sum of its terms' sizes.
struct DirectSum {
  double value = 0.0;
  double size = 0.0;
};

/// Output (y, x, o) by two loops over the pixels that it sees.
DirectSum directSum(const Case& c, const WeightTable& weights, const FeatureMap& in, size_t y,
                    size_t x, size_t o) {
  const size_t k = c.grid.kernel;
  const std::vector<float> weight = weights.floats("layer.weight", {c.outputs, c.inputs, k, k});
  const std::vector<float> bias = weights.floats("layer.bias", {c.outputs});
  DirectSum sum = {static_cast<double>(bias[o]), std::abs(static_cast<double>(bias[o]))};
  for (size_t dy = 0; dy < k; ++dy) {
    for (size_t dx = 0; dx < k; ++dx) {
      const size_t row = y * c.grid.stride + dy, column = x * c.grid.stride + dx;
      if (row < c.grid.pad_before || row >= in.height + c.grid.pad_before) continue;
      if (column < c.grid.pad_before || column >= in.width + c.grid.pad_before) continue;
      const size_t pixel = (row - c.grid.pad_before) * in.width + column - c.grid.pad_before;
      for (size_t i = 0; i < c.inputs; ++i) {
        const double term = static_cast<double>(in.values[pixel * c.inputs + i]) *
                            static_cast<double>(weight[((o * c.inputs + i) * k + dy) * k + dx]);
        sum.value += term;
        sum.size += std::abs(term);
      }
    }
  }
  return sum;
}

/// Compares outputs of all borders and of every 7th row and column; all outputs of a small map.
void expectDirectSums(const Case& c, const WeightTable& weights, const FeatureMap& in,
                      const FeatureMap& out) {
  // Each of the sum's steps rounds by half a unit of at most the sum of sizes.
  const double steps = static_cast<double>(c.inputs * c.grid.kernel * c.grid.kernel + 1);
  const size_t step = out.pixelCount() * out.channels < 20000 ? 1 : 7;
  for (size_t y = 0; y < out.height; ++y) {
    if (y % step != 0 && y + 1 != out.height) continue;
    for (size_t x = 0; x < out.width; ++x) {
      if (x % step != 0 && x + 1 != out.width) continue;
      for (size_t o = 0; o < out.channels; o += step) {
        const DirectSum sum = directSum(c, weights, in, y, x, o);
        const double seen = static_cast<double>(out.values[(y * out.width + x) * out.channels + o]);
        ASSERT_NEAR(seen, sum.value, steps * 0x1.0p-24 * sum.size)
            << c.name << " at " << y << ", " << x << ", " << o;
      }
    }
  }
}

const Case kCases[] = {
    {"3x3", {3, 1, 1, 1}, 11, 29, 5, 7},
    {"3x3 on a pixel", {3, 1, 1, 1}, 1, 1, 3, 4},
    {"3x3 on a column", {3, 1, 1, 1}, 30, 1, 4, 3},
    {"halving", {3, 2, 0, 1}, 18, 52, 6, 5},
    {"halving two pixels", {3, 2, 0, 1}, 2, 2, 6, 5},
    {"halving an odd map", {3, 2, 0, 1}, 7, 9, 3, 3},
    {"1x1", {1, 1, 0, 0}, 9, 27, 10, 6},
    {"patches", {16, 16, 0, 0}, 48, 80, 3, 8},
    {"two panels of outputs", {3, 1, 1, 1}, 4, 5, 8, 300},
    {"5x5 padded unevenly", {5, 2, 1, 3}, 13, 10, 2, 3},
    {"padding wider than the map", {3, 1, 3, 3}, 1, 2, 2, 2},
};

TEST(Convolution, SumsWhatEachOutputSees) {
  for (const Case& c : kCases) {
    const WeightTable weights = weightsOf(c).table();
    const Convolution layer(weights, "layer", c.inputs, c.outputs, c.grid);
    const FeatureMap in = randomMap(c.height, c.width, c.inputs, 99);
    for (const MatrixBackend* backend : matrixBackends()) {
      NetworkRun run;
      run.backend = backend;
      const FeatureMap out = layer.apply(run, in);
      ASSERT_EQ(out.height, c.grid.outputs(c.height)) << c.name << " by " << backend->name();
      ASSERT_EQ(out.width, c.grid.outputs(c.width)) << c.name << " by " << backend->name();
      expectDirectSums(c, weights, in, out);
    }
  }
}

TEST(Convolution, CountsNeighboursWhereAllWeightsAreOne) {
  MadeWeights weights;
  weights.add("layer.weight", {1, 1, 3, 3}, std::vector<float>(9, 1.0f));
  weights.add("layer.bias", {1}, {0.5f});
  const Convolution layer(weights.table(), "layer", 1, 1, {3, 1, 1, 1});
  FeatureMap in = FeatureMap::ofSize(3, 3, 1);
  std::fill(in.values.begin(), in.values.end(), 1.0f);
  const FeatureMap out = layer.apply({}, in);
  EXPECT_THAT(out.values,
              testing::ElementsAre(4.5f, 6.5f, 4.5f, 6.5f, 9.5f, 6.5f, 4.5f, 6.5f, 4.5f));
  EXPECT_EQ(layer.flops(3, 3), 2.0 * 9 * 9);
}

TEST(Convolution, PadsOnTheRightAndBelowAloneWhenItHalves) {
  MadeWeights weights;
  weights.add("layer.weight", {1, 1, 3, 3}, {0, 0, 0, 0, 0, 0, 0, 0, 1});
  weights.add("layer.bias", {1}, {0.0f});
  const Convolution layer(weights.table(), "layer", 1, 1, {3, 2, 0, 1});
  FeatureMap in = FeatureMap::ofSize(4, 4, 1);
  for (size_t i = 0; i < 16; ++i) in.values[i] = static_cast<float>(i);
  // Row 2 and column 2 of the map; rows and columns 4 are padding.
  EXPECT_THAT(layer.apply({}, in).values, testing::ElementsAre(10.0f, 0.0f, 0.0f, 0.0f));
}

TEST(Convolution, NormalisesWhatItReadsAndLeavesThePaddingZero) {
  const Case c = {"normed", {3, 1, 1, 1}, 10, 30, 6, 4};
  MadeWeights made = weightsOf(c);
  made.addLayer("norm", {c.inputs});
  const WeightTable weights = made.table();
  const FeatureMap in = randomMap(c.height, c.width, c.inputs, 5);
  const ChannelNorm norm = GroupNorm(weights, "norm", c.inputs, 3, 1e-6f).of({}, in);
  FeatureMap activated = FeatureMap::ofSize(c.height, c.width, c.inputs);
  normalise(norm, in.pixelCount(), in.values.data(), activated.values.data());
  for (float& value : activated.values) value = value / (1.0f + std::exp(-value));
  const Convolution layer(weights, "layer", c.inputs, c.outputs, c.grid);
  const FeatureMap expected = layer.apply({}, activated);
  const FeatureMap seen = layer.apply({}, in, &norm);
  for (size_t i = 0; i < seen.values.size(); ++i) {
    // exp() of the vector kernel differs by some units of 6e-8; 54 terms of about 0.3.
    ASSERT_NEAR(seen.values[i], expected.values[i], 3e-6f);
  }
}

TEST(Convolution, AddsToWhatIsThere) {
  const Case c = {"adding", {3, 1, 1, 1}, 9, 25, 4, 260};
  const WeightTable weights = weightsOf(c).table();
  const Convolution layer(weights, "layer", c.inputs, c.outputs, c.grid);
  const FeatureMap in = randomMap(c.height, c.width, c.inputs, 7);
  const FeatureMap sums = layer.apply({}, in);
  FeatureMap out = randomMap(c.height, c.width, c.outputs, 8);
  const FeatureMap before = out;
  layer.apply({}, in, nullptr, out, ConvolutionResult::kAdds);
  for (size_t i = 0; i < out.values.size(); ++i) {
    ASSERT_EQ(out.values[i], before.values[i] + sums.values[i]);
  }
}

TEST(Convolution, GivesTheSameBitsForAnyNumberOfThreads) {
  const Case c = {"threads", {3, 1, 1, 1}, 40, 70, 16, 24};
  const WeightTable weights = weightsOf(c).table();
  const Convolution layer(weights, "layer", c.inputs, c.outputs, c.grid);
  const FeatureMap in = randomMap(c.height, c.width, c.inputs, 7);
  FeatureMap one;
  withThreads(1, [&] { one = layer.apply({}, in); });
  for (const unsigned threads : {2u, 3u, 7u}) {
    withThreads(threads, [&] { EXPECT_EQ(layer.apply({}, in).values, one.values); });
  }
}

ErrorCode errorOf(const std::function<void()>& body, std::string* message = nullptr) {
  try {
    body();
  } catch (const Error& error) {
    if (message != nullptr) *message = error.what();
    return error.code();
  }
  return ErrorCode::kInternal;
}

TEST(Convolution, RefusesWeightsOfAnotherShape) {
  MadeWeights weights;
  weights.addLayer("layer", {4, 3, 3, 3});
  std::string message;
  EXPECT_EQ(errorOf([&] { Convolution(weights.table(), "layer", 3, 4, kPixelGrid); }, &message),
            ErrorCode::kFormat);
  EXPECT_THAT(message, HasSubstr("net.safetensors"));
  EXPECT_THAT(message, HasSubstr("layer.weight"));
}

TEST(Convolution, RefusesNumbersThatAreNotFinite) {
  MadeWeights weights;
  std::vector<float> values = numbers(36, 3);
  values[20] = std::numeric_limits<float>::quiet_NaN();
  weights.add("layer.weight", {2, 2, 3, 3}, values);
  weights.add("layer.bias", {2}, {0.0f, 0.0f});
  const Convolution layer(weights.table(), "layer", 2, 2, {3, 1, 1, 1});
  std::string message;
  EXPECT_EQ(errorOf([&] { layer.apply({}, randomMap(4, 4, 2, 1)); }, &message), ErrorCode::kFormat);
  EXPECT_THAT(message, HasSubstr("layer.weight"));
}

TEST(Convolution, RefusesMapsThatDoNotFit) {
  const Case c = {"small", {16, 16, 0, 0}, 16, 16, 3, 2};
  const Convolution layer(weightsOf(c).table(), "layer", 3, 2, c.grid);
  EXPECT_EQ(errorOf([&] { layer.apply({}, randomMap(15, 16, 3, 1)); }),
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(errorOf([&] { layer.apply({}, randomMap(16, 16, 4, 1)); }),
            ErrorCode::kInvalidArgument);
}

TEST(Convolution, StopsWhenCancelled) {
  const Case c = {"cancelled", {3, 1, 1, 1}, 9, 9, 2, 2};
  const Convolution layer(weightsOf(c).table(), "layer", 2, 2, c.grid);
  Progress progress;
  progress.cancel();
  NetworkRun run;
  run.progress = &progress;
  EXPECT_EQ(errorOf([&] { layer.apply(run, randomMap(9, 9, 2, 1)); }), ErrorCode::kCancelled);
}

}  // namespace
}  // namespace stipple
