#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/parallel.h"
#include "io/scratch_folder.h"
#include "nn/highway_backend.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/kernels/panel_kernel.h"
#include "nn/linear.h"
#include "nn/matrix_backend.h"
#include "test_numbers.h"

namespace stipple {
namespace {

/// A weight [outputs, inputs] of a type, at an odd address; and a bias.
WeightTable tableOf(WeightType type, size_t outputs, size_t inputs) {
  TableBuilder builder;
  builder.add("fc.bias", {outputs}, numbers(outputs, 3));
  const std::vector<float> weight = numbers(outputs * inputs, 2);
  if (type == WeightType::kFloat32)
    return builder.add("fc.weight", {outputs, inputs}, weight).table();
  if (type == WeightType::kBfloat16) {
    return builder.addBfloat16("fc.weight", {outputs, inputs}, weight).table();
  }
  // Any sign and fraction, exponents of 2^-15 (numbers below the normal ones) to 2^0.
  std::vector<uint16_t> halves;
  for (size_t i = 0; i < weight.size(); ++i) {
    halves.push_back(static_cast<uint16_t>(mixBits(i) & 0xbfff));
  }
  return builder
      .addBytes("fc.weight", type, "F16", {outputs, inputs}, halves.data(), 2 * halves.size())
      .table();
}

std::vector<float> applied(const Linear& linear, const NetworkRun& run, size_t rows,
                           const std::vector<float>& in) {
  std::vector<float> out(rows * linear.outputs());
  linear.apply(run, rows, in.data(), out.data());
  return out;
}

TEST(FewRows, HaveTheBitsThatTheyHaveAmongMany) {
  NetworkRun run;
  run.backend = &highwayBackend();
  for (const WeightType type :
       {WeightType::kFloat32, WeightType::kFloat16, WeightType::kBfloat16}) {
    for (const auto& [inputs, outputs] :
         {std::pair<size_t, size_t>{1, 1}, {257, 33}, {1100, 290}}) {
      const Linear linear(tableOf(type, outputs, inputs), "fc", inputs, outputs);
      constexpr size_t kMany = Linear::kFewRows + 1;
      const std::vector<float> in = numbers(kMany * inputs, 1);
      const std::vector<float> many = applied(linear, run, kMany, in);
      for (const size_t rows : {size_t{1}, size_t{2}, size_t{7}, size_t{31}, size_t{33}, size_t{65},
                                Linear::kFewRows}) {
        const std::vector<float> few = applied(linear, run, rows, in);
        // NaN would be equal too.
        ASSERT_EQ(std::memcmp(few.data(), many.data(), few.size() * sizeof(float)), 0)
            << rows << " rows, " << inputs << " inputs, type " << static_cast<int>(type);
      }
    }
  }
}

TEST(FewRows, HaveTheSameBitsForAnyNumberOfThreadsAndByAnyBackend) {
  const Linear linear(tableOf(WeightType::kFloat16, 700, 300), "fc", 300, 700);
  const std::vector<float> in = numbers(37 * 300, 8);
  std::vector<float> first;
  for (const MatrixBackend* backend : matrixBackends()) {
    for (const unsigned threads : {1u, 2u, 5u}) {
      NetworkRun run;
      run.backend = backend;
      std::vector<float> out;
      withThreads(threads, [&] { out = applied(linear, run, 37, in); });
      if (first.empty()) first = out;
      EXPECT_EQ(out, first) << backend->name() << " " << threads;
    }
  }
}

// What few rows stand on, for kernels that this processor would not choose: a product and the same
// one turned around, which begins with sums that are the bias, have the same bits.
TEST(FewRows, AreTheSameProductTurnedAroundByEveryKernel) {
  constexpr size_t kRows = 19, kInner = 301, kColumns = 45;
  const std::vector<float> in = numbers(kRows * kInner, 1);
  const std::vector<float> weight = numbers(kColumns * kInner, 2);
  const std::vector<float> bias = numbers(kColumns, 3);
  for (const PanelKernel& kernel : panelKernels()) {
    std::vector<float> weights(stripFloats(kernel.strip, kInner, kColumns));
    packColumns(kernel.strip, kInner, kColumns, weight.data(), kInner, weights.data());
    std::vector<float> straight(kRows * kColumns), turned(kColumns * kRows);
    PanelProduct product;
    product.shape = {kRows, kInner, kColumns};
    product.a = in.data();
    product.a_stride = kInner;
    product.b = weights.data();
    product.bias = bias.data();
    product.c = straight.data();
    product.c_stride = kColumns;
    kernel.multiply(product);
    std::vector<float> rows(stripFloats(kernel.strip, kInner, kRows));
    packColumns(kernel.strip, kInner, kRows, in.data(), kInner, rows.data());
    for (size_t o = 0; o < kColumns; ++o) std::fill_n(&turned[o * kRows], kRows, bias[o]);
    product.shape = {kColumns, kInner, kRows};
    product.a = weight.data();
    product.b = rows.data();
    product.start = PanelStart::kSums;
    product.c = turned.data();
    product.c_stride = kRows;
    kernel.multiply(product);
    for (size_t row = 0; row < kRows; ++row) {
      for (size_t o = 0; o < kColumns; ++o) {
        ASSERT_EQ(turned[o * kRows + row], straight[row * kColumns + o]) << kernel.target;
      }
    }
  }
}

TEST(FewRows, WidenEveryHalfAsItIs) {
  std::vector<uint8_t> bytes(2 * 65536 + 1);
  for (size_t i = 0; i < 65536; ++i) {
    const auto half = static_cast<uint16_t>(i);
    std::memcpy(&bytes[2 * i + 1], &half, 2);
  }
  for (const WeightType type : {WeightType::kFloat16, WeightType::kBfloat16}) {
    std::vector<float> expected(65536);
    widen({type, "", {}, bytes.data() + 1}, 0, expected);
    for (const LayerKernel& kernel : layerKernels()) {
      std::vector<float> out(65536);
      kernel.widen(type, out.size(), bytes.data() + 1, out.data());
      for (size_t i = 0; i < out.size(); ++i) {
        if (!std::isfinite(expected[i])) continue;  // refused before
        ASSERT_EQ(std::bit_cast<uint32_t>(out[i]), std::bit_cast<uint32_t>(expected[i]))
            << kernel.target << " " << i;
      }
    }
  }
}

TEST(FewRows, WidenAnyCountAndNothingBeyondIt) {
  const std::vector<float> values = numbers(70, 1);
  std::vector<uint8_t> bytes(70 * 4 + 1);
  std::memcpy(bytes.data() + 1, values.data(), 70 * 4);
  for (const WeightType type :
       {WeightType::kFloat32, WeightType::kFloat16, WeightType::kBfloat16}) {
    for (const LayerKernel& kernel : layerKernels()) {
      for (size_t count = 0; count <= 70; ++count) {
        std::vector<float> expected(count), out(count + 1, 7.0f);
        // Bits of float32 numbers whose lower halves are halves below 1 and NaN among them.
        widen({type, "", {}, bytes.data() + 1}, 0, expected);
        kernel.widen(type, count, bytes.data() + 1, out.data());
        EXPECT_EQ(out[count], 7.0f) << kernel.target << " " << count;
        for (size_t i = 0; i < count; ++i) {
          if (!std::isfinite(expected[i])) continue;
          EXPECT_EQ(out[i], expected[i]) << kernel.target << " " << count;
        }
      }
    }
  }
}

TEST(FewRows, RefuseWeightsThatAreNotFiniteAtEveryUse) {
  std::vector<float> weight = numbers(60 * 3, 1);
  weight[50 * 3 + 1] = std::numeric_limits<float>::quiet_NaN();
  const WeightTable table = TableBuilder().add("fc.weight", {60, 3}, weight).table();
  const Linear linear(table, "fc", 3, 60, LinearBias::kNone);
  const std::vector<float> in(3);
  std::vector<float> out(60);
  for (int i = 0; i < 2; ++i) {
    expectError(ErrorCode::kFormat, {"'fc.weight'", "NaN", "number 151"},
                [&] { linear.apply({}, 1, in.data(), out.data()); });
  }
}

}  // namespace
}  // namespace stipple
