#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "activated_by_hand.h"
#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/norms.h"
#include "nn/positions.h"
#include "test_numbers.h"

namespace stipple {
namespace {

TEST(Activations, EveryKernelKeepsTheBoundOfItsError) {
  std::vector<float> x = {0.0f, -0.0f, 1e-30f, -1e-30f, 100.0f, -100.0f, 1e6f, -1e6f, 1e18f};
  for (int i = -60000; i <= 60000; ++i) x.push_back(static_cast<float>(i) * 2.5e-4f);
  for (const LayerKernel& kernel : layerKernels()) {
    for (const Activation activation : kActivations) {
      std::vector<float> out = x;
      kernel.activate(activation, out.size(), out.data());
      for (size_t i = 0; i < x.size(); ++i) {
        const double expected = activatedByHand(activation, static_cast<double>(x[i]));
        // What nn/activations.h says: 4 ulp or 1e-7.
        const double tolerance = std::max(1e-7, 4 * 1.2e-7 * std::abs(expected));
        ASSERT_NEAR(static_cast<double>(out[i]), expected, tolerance)
            << kernel.target << " " << static_cast<int>(activation) << " at " << x[i];
      }
    }
  }
}

TEST(Activations, GiveANumberTheSameWhereverItLies) {
  const std::vector<float> x = numbers(40000, 1);
  for (const Activation activation : kActivations) {
    std::vector<float> whole = x, parts = x;
    activate(activation, whole);
    for (size_t i = 0; i < parts.size(); i += 7) {
      activate(activation, {parts.data() + i, std::min<size_t>(7, parts.size() - i)});
    }
    EXPECT_EQ(whole, parts);
  }
}

TEST(Activations, GateAndAdd) {
  const std::vector<float> gate = numbers(37, 1), up = numbers(37, 2);
  std::vector<float> out(37);
  siluGate(37, gate.data(), up.data(), out.data());
  for (size_t i = 0; i < 37; ++i) {
    EXPECT_NEAR(static_cast<double>(out[i]),
                activatedByHand(Activation::kSilu, static_cast<double>(gate[i])) *
                    static_cast<double>(up[i]),
                2e-7);
  }
  std::vector<float> x = {1, 2, 3, 4}, y = {10, 20, 30, 40};
  addScaled(2, 2, {}, y.data(), x.data());
  EXPECT_EQ(x, (std::vector<float>{11, 22, 33, 44}));
  const std::vector<float> factor = {2, -1};
  addScaled(2, 2, factor, y.data(), x.data());
  EXPECT_EQ(x, (std::vector<float>{31, 2, 93, 4}));
}

TEST(Narrow, EveryKernelTakesTheNearestAndOfTwoTheEven) {
  const float inf = std::numeric_limits<float>::infinity();
  // 1 + 2^-8 lies in the middle of 1 and 1 + 2^-7, 1 + 3 2^-8 in the middle of that and 1 + 2^-6.
  const std::vector<float> from = {1.0f, 1.00390625f, 1.01171875f,   1.0039064f, -2.5f, 0.0f, -0.0f,
                                   inf,  -inf,        3.4028235e38f, 1.17e-38f,  1e-41f};
  const std::vector<uint16_t> expected = {0x3f80, 0x3f80, 0x3f82, 0x3f81, 0xc020, 0x0000,
                                          0x8000, 0x7f80, 0xff80, 0x7f80, 0x007f, 0x0000};
  for (const LayerKernel& kernel : layerKernels()) {
    // As the beginning of a vector, and at its end.
    for (const size_t first : {size_t{0}, size_t{29}}) {
      std::vector<float> padded(first, 7.0f);
      padded.insert(padded.end(), from.begin(), from.end());
      std::vector<uint16_t> out(padded.size());
      kernel.narrow(padded.size(), padded.data(), out.data());
      for (size_t i = 0; i < from.size(); ++i) {
        EXPECT_EQ(out[first + i], expected[i]) << kernel.target << " " << from[i];
      }
    }
    const float nan = std::numeric_limits<float>::quiet_NaN();
    uint16_t narrow = 0;
    kernel.narrow(1, &nan, &narrow);
    EXPECT_EQ(narrow & 0x7fff, 0x7fc0) << kernel.target;
  }
}

TEST(Softmax, EveryKernelAgreesWithDoubleOverSeveralTiles) {
  const size_t counts[] = {37, 16, 3, 1};
  for (const LayerKernel& kernel : layerKernels()) {
    SoftmaxRow row;
    row.peak = std::numeric_limits<float>::lowest();
    row.scale = 7.0f;
    std::vector<float> out(19, 0.0f);
    std::vector<double> all;
    double total = 0;
    uint64_t seed = 1;
    for (const size_t count : counts) {
      std::vector<float> scores = numbers(count, seed++);
      const std::vector<float> bias = numbers(count, seed++);
      for (size_t i = 0; i < count; ++i) {
        all.push_back(7.0 * static_cast<double>(scores[i]) + static_cast<double>(bias[i]));
      }
      row.scores = scores.data();
      row.keys = count;
      row.key_bias = bias.data();
      row.out = out.data();
      row.width = out.size();
      kernel.softmax(row);
      // The sum of all exponentials so far, in `out` too, as if every value were 1.
      float here = 0;
      for (const float power : scores) here += power;
      for (float& value : out) value += here;
    }
    const double peak = *std::max_element(all.begin(), all.end());
    for (const double value : all) total += std::exp(value - peak);
    EXPECT_NEAR(static_cast<double>(row.peak), peak, 1e-6) << kernel.target;
    // Scores of up to 8 are rounded by 5e-7; 57 sums add less.
    EXPECT_NEAR(static_cast<double>(row.sum) / total, 1.0, 2e-6) << kernel.target;
    for (const float value : out) EXPECT_NEAR(static_cast<double>(value) / total, 1.0, 3e-6);
  }
}

TEST(Softmax, EveryKernelRoundsToBfloat16WhereItIsAskedTo) {
  for (const LayerKernel& kernel : layerKernels()) {
    std::vector<float> scores = numbers(37, 3), same = scores;
    std::vector<uint16_t> narrow(38, 0x1234), expected(37);
    SoftmaxRow row;
    row.peak = std::numeric_limits<float>::lowest();
    row.keys = 37;
    row.scores = same.data();
    kernel.softmax(row);
    kernel.narrow(37, same.data(), expected.data());
    const float sum = row.sum;
    row.peak = std::numeric_limits<float>::lowest();
    row.sum = 0.0f;
    row.scores = scores.data();
    row.narrow = narrow.data();
    kernel.softmax(row);
    EXPECT_EQ(row.sum, sum) << kernel.target;
    EXPECT_EQ(narrow.back(), 0x1234) << kernel.target;
    narrow.pop_back();
    EXPECT_EQ(narrow, expected) << kernel.target;
  }
}

TEST(Softmax, EveryKernelTakesRowsWithoutAKey) {
  const float none = -std::numeric_limits<float>::infinity();
  for (const LayerKernel& kernel : layerKernels()) {
    std::vector<float> scores(21, 0.5f), bias(21, none);
    SoftmaxRow row;
    row.scores = scores.data();
    row.keys = scores.size();
    row.key_bias = bias.data();
    row.peak = std::numeric_limits<float>::lowest();
    kernel.softmax(row);
    EXPECT_EQ(row.sum, 0.0f) << kernel.target;
    for (const float value : scores) EXPECT_EQ(value, 0.0f) << kernel.target;
  }
}

TEST(LayerNorm, AgreesWithDoubleAndModulates) {
  const size_t width = 37, rows = 700;
  std::vector<float> in = numbers(rows * width, 1);
  // A mean far from 0, and a row without any variance.
  for (float& value : in) value += 100.0f;
  std::fill_n(in.begin(), width, 3.0f);
  const std::vector<float> weight = numbers(width, 2), bias = numbers(width, 3),
                           scale = numbers(width, 4), shift = numbers(width, 5);
  for (const bool is_affine : {false, true}) {
    for (const bool is_modulated : {false, true}) {
      LayerNorm norm;
      norm.width = width;
      norm.epsilon = 1e-5f;
      if (is_affine) norm.weight = weight, norm.bias = bias;
      if (is_modulated) norm.scale = scale, norm.shift = shift;
      std::vector<float> first;
      for (const unsigned threads : {1u, 5u}) {
        std::vector<float> out = in;
        withThreads(threads, [&] { layerNorm(norm, rows, out.data(), out.data()); });
        if (first.empty()) first = out;
        EXPECT_EQ(out, first);
      }
      for (size_t row = 0; row < rows; ++row) {
        double mean = 0, variance = 0;
        for (size_t i = 0; i < width; ++i) mean += static_cast<double>(in[row * width + i]);
        mean /= static_cast<double>(width);
        for (size_t i = 0; i < width; ++i) {
          variance += std::pow(static_cast<double>(in[row * width + i]) - mean, 2);
        }
        variance /= static_cast<double>(width);
        for (size_t i = 0; i < width; ++i) {
          double expected = (static_cast<double>(in[row * width + i]) - mean) /
                            std::sqrt(variance + static_cast<double>(norm.epsilon));
          if (is_affine) {
            expected = expected * static_cast<double>(weight[i]) + static_cast<double>(bias[i]);
          }
          if (is_modulated) {
            expected =
                expected * (1 + static_cast<double>(scale[i])) + static_cast<double>(shift[i]);
          }
          // The mean, about 100, is rounded to 4e-6, and the deviation is about 0.6.
          ASSERT_NEAR(static_cast<double>(first[row * width + i]), expected, 3e-5);
        }
      }
    }
  }
}

TEST(RmsNorm, DividesEachHeadByItsLength) {
  std::vector<float> values = {3, 4, 0, 0, 99, 6, 8, 5, 12, 99};
  const std::vector<float> gamma = {1, 2, 1, 1};
  rmsNormHeads(2, 2, 2, gamma, values.data(), 5);
  const float root = std::sqrt(2.0f);
  const std::vector<float> expected = {
      0.6f * root,   1.6f * root,    0, 0, 99, 0.6f * root, 1.6f * root,
      5 * root / 13, 12 * root / 13, 99};
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 5e-7f) << i;
}

TEST(Positions, HaveSinesThenCosinesOfEachAxis) {
  // Two frequencies, 1 and 1024; width 14: the last two numbers stay.
  const std::vector<float> points = {0.25f, -0.5f, 0.0f};
  std::vector<float> out(14, 1.0f);
  addPositions(PositionEncoding::kGeometric, 1, 14, points.data(), out.data());
  const float half = std::sqrt(0.5f);
  const std::vector<float> expected = {half, 0, half, 1, -1, 0, 0, 1, 0, 0, 1, 1, 0, 0};
  for (size_t i = 0; i < out.size(); ++i) {
    // 512 pi is rounded to 1e-4.
    EXPECT_NEAR(out[i], 1.0f + expected[i], 2e-4f) << i;
  }
}

TEST(Positions, OfTheFlowNetworkRoundAnglesAsFloat32) {
  const size_t width = 1024, count = 170;
  const std::vector<float> points = {0.7311f, 0.1f, 0.9999f};
  std::vector<float> out(width, 0.0f);
  addPositions(PositionEncoding::kPowers, 1, width, points.data(), out.data());
  for (const size_t i : {size_t{0}, size_t{15}, size_t{16}, size_t{93}}) {
    // Exponents 0, 15, 0 and 8: powers of two, so that only the last product rounds.
    const double exponent =
        i < 16 ? static_cast<double>(i) : 16.0 * static_cast<double>(i - 16) / 154;
    const float turns = points[2] * static_cast<float>(std::exp2(exponent)) * 2.0f;
    const float angle = turns * std::numbers::pi_v<float>;
    EXPECT_NEAR(static_cast<double>(out[4 * count + i]), std::sin(static_cast<double>(angle)),
                1e-7);
    EXPECT_NEAR(static_cast<double>(out[5 * count + i]), std::cos(static_cast<double>(angle)),
                1e-7);
  }
  for (size_t i = 6 * count; i < width; ++i) EXPECT_EQ(out[i], 0.0f);
}

TEST(TimeEncoding, HasCosinesThenSines) {
  const std::vector<float> encoding = timeEncoding(2.0, 10000.0, 4);
  const double angles[] = {2.0, 2.0 / 100.0};
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(static_cast<double>(encoding[i]), std::cos(angles[i]), 1e-7);
    EXPECT_NEAR(static_cast<double>(encoding[2 + i]), std::sin(angles[i]), 1e-7);
  }
}

TEST(Rotary, TurnsHalvesAndNeighbours) {
  const float c = std::cos(0.3f), s = std::sin(0.3f), e = std::cos(1.1f), f = std::sin(1.1f);
  const RotaryTable halves = {2, {c, e}, {s, f}};
  std::vector<float> x = {1, 2, 3, 4, 5, 6, 7, 8, 99};
  rotateHalves(halves, 1, 2, 4, x.data(), 9);
  const std::vector<float> by_halves = {c - 3 * s,     2 * e - 4 * f, 3 * c + s,
                                        4 * e + 2 * f, 5 * c - 7 * s, 6 * e - 8 * f,
                                        7 * c + 5 * s, 8 * e + 6 * f, 99};
  for (size_t i = 0; i < 9; ++i) EXPECT_NEAR(x[i], by_halves[i], 1e-6f) << i;
  const RotaryTable adjacent = {2, {c, e}, {s, f}};
  std::vector<float> y = {1, 2, 3, 4, 99};
  rotateAdjacent(adjacent, 1, 2, 2, y.data(), 5);
  const std::vector<float> by_neighbours = {c - 2 * s, s + 2 * c, 3 * e - 4 * f, 3 * f + 4 * e, 99};
  for (size_t i = 0; i < 5; ++i) EXPECT_NEAR(y[i], by_neighbours[i], 1e-6f) << i;
}

}  // namespace
}  // namespace stipple
