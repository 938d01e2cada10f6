#include "nn/linear.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "io/scratch_folder.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/kernels/panel_kernel.h"
#include "nn/matrix_backend.h"
#include "test_numbers.h"

namespace stipple {
namespace {

struct Case {
  size_t rows, inputs, outputs;
};

// On both sides of rows that kernels take at once (1, 3, 4, 6, 12), of blocks of rows (96, 192), of
// rows that are few (256), of steps (256, 1024), strips (8 to 32 columns), panels (256) and outputs
// of a task (24); and empty.
const Case kCases[] = {{1, 1, 1},       {2, 257, 33},   {13, 64, 31},  {97, 300, 8},
                       {256, 40, 25},   {33, 1030, 49}, {257, 300, 8}, {385, 16, 257},
                       {268, 512, 300}, {12, 256, 32},  {0, 4, 4}};

/// Each output against a sum in double; in [rows, inputs] and out [rows, outputs] may have gaps.
void expectProduct(const Case& c, const std::vector<float>& in, size_t in_stride,
                   const std::vector<float>& weight, const std::vector<float>& bias,
                   const std::vector<float>& out, size_t out_stride, double unit,
                   const std::string& who) {
  for (size_t row = 0; row < c.rows; ++row) {
    for (size_t o = 0; o < c.outputs; ++o) {
      double expected = bias.empty() ? 0.0 : static_cast<double>(bias[o]);
      double size = std::abs(expected);
      for (size_t k = 0; k < c.inputs; ++k) {
        const double term = static_cast<double>(in[row * in_stride + k]) *
                            static_cast<double>(weight[o * c.inputs + k]);
        expected += term;
        size += std::abs(term);
      }
      // A sum of n terms is off by at most n rounding errors of their sizes, which cancel to about
      // the root of that.
      const double tolerance = unit * size * (2 + std::sqrt(static_cast<double>(c.inputs)));
      ASSERT_NEAR(static_cast<double>(out[row * out_stride + o]), expected, tolerance)
          << who << " " << c.rows << "x" << c.inputs << "x" << c.outputs;
    }
  }
}

TEST(PanelKernel, EveryKernelAgreesWithSumsInDouble) {
  for (const PanelKernel& kernel : panelKernels()) {
    for (const Case& c : kCases) {
      const std::vector<float> in = numbers(c.rows * c.inputs, 1);
      const std::vector<float> weight = numbers(c.outputs * c.inputs, 2);
      const std::vector<float> bias = numbers(c.outputs, 3);
      std::vector<float> strips(stripFloats(kernel.strip, c.inputs, c.outputs), 1e30f);
      packColumns(kernel.strip, c.inputs, c.outputs, weight.data(), c.inputs, strips.data());
      std::vector<float> transposed(weight.size());
      for (size_t o = 0; o < c.outputs; ++o) {
        for (size_t k = 0; k < c.inputs; ++k) {
          transposed[k * c.outputs + o] = weight[o * c.inputs + k];
        }
      }
      std::vector<float> by_rows(strips.size(), 1e30f);
      packRows(kernel.strip, c.inputs, c.outputs, transposed.data(), c.outputs, by_rows.data());
      ASSERT_EQ(strips, by_rows);
      // The last number of each row is a gap, which stays.
      const size_t stride = c.outputs + 1;
      std::vector<float> out(c.rows * stride, 99.0f);
      PanelProduct product;
      product.shape = {c.rows, c.inputs, c.outputs};
      product.a = in.data();
      product.a_stride = c.inputs;
      product.b = strips.data();
      product.bias = bias.data();
      product.c = out.data();
      product.c_stride = stride;
      kernel.multiply(product);
      expectProduct(c, in, c.inputs, weight, bias, out, stride, 6e-8, kernel.target);
      // Once more on top: twice the product and once the bias.
      product.start = PanelStart::kSums;
      kernel.multiply(product);
      std::vector<float> twice = weight;
      for (float& value : twice) value *= 2;
      expectProduct(c, in, c.inputs, twice, bias, out, stride, 6e-8, kernel.target);
      for (size_t row = 0; row < c.rows; ++row) EXPECT_EQ(out[row * stride + c.outputs], 99.0f);
    }
  }
}

TEST(Linear, EveryBackendAgreesWithSumsInDouble) {
  for (const MatrixBackend* backend : matrixBackends()) {
    EXPECT_FALSE(backend->instructionSets().empty());
    for (const Case& c : kCases) {
      const std::vector<float> weight = numbers(c.outputs * c.inputs, 2);
      const std::vector<float> bias = numbers(c.outputs, 3);
      const WeightTable table = TableBuilder()
                                    .add("fc.weight", {c.outputs, c.inputs}, weight)
                                    .add("fc.bias", {c.outputs}, bias)
                                    .table();
      const Linear linear(table, "fc", c.inputs, kAnySize);
      ASSERT_EQ(linear.inputs(), c.inputs);
      ASSERT_EQ(linear.outputs(), c.outputs);
      const size_t in_stride = c.inputs + 3, out_stride = c.outputs + 5;
      const std::vector<float> in = numbers(c.rows * in_stride, 1);
      std::vector<float> out(c.rows * out_stride, 99.0f);
      NetworkRun run;
      run.backend = backend;
      linear.apply(run, c.rows, in.data(), in_stride, out.data(), out_stride);
      expectProduct(c, in, in_stride, weight, bias, out, out_stride, 6e-8, backend->name());
      for (size_t row = 0; row < c.rows; ++row) {
        for (size_t i = c.outputs; i < out_stride; ++i) EXPECT_EQ(out[row * out_stride + i], 99.0f);
      }
    }
  }
}

TEST(Linear, TakesWeightsOfSixteenBitsAndNoBias) {
  for (const Case& c : {Case{5, 70, 40}, Case{Linear::kFewRows + 5, 70, 40}}) {
    const std::vector<float> weight = numbers(c.outputs * c.inputs, 4);
    const WeightTable table = TableBuilder().addBfloat16("fc.weight", {40, 70}, weight).table();
    std::vector<float> cut(weight.size());
    widen(table.require("fc.weight", {40, 70}), 0, cut);
    const std::vector<float> in = numbers(c.rows * c.inputs, 5);
    for (const MatrixBackend* backend : matrixBackends()) {
      std::vector<float> out(c.rows * c.outputs);
      NetworkRun run;
      run.backend = backend;
      Linear(table, "fc", 70, 40, LinearBias::kNone).apply(run, c.rows, in.data(), out.data());
      expectProduct(c, in, c.inputs, cut, {}, out, c.outputs, 6e-8, backend->name());
    }
  }
}

TEST(Linear, RoundsFactorsToBfloat16WhereItIsAskedTo) {
  const Case c = {200, 300, 290};
  const std::vector<float> weight = numbers(c.outputs * c.inputs, 2);
  const std::vector<float> bias = numbers(c.outputs, 3);
  const std::vector<float> in = numbers(c.rows * c.inputs, 1);
  const WeightTable table = TableBuilder()
                                .add("fc.weight", {c.outputs, c.inputs}, weight)
                                .add("fc.bias", {c.outputs}, bias)
                                .table();
  const auto rounded = [](std::vector<float> values) {
    std::vector<uint16_t> halves(values.size());
    scalarLayerKernel().narrow(values.size(), values.data(), halves.data());
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = std::bit_cast<float>(static_cast<uint32_t>(halves[i]) << 16);
    }
    return values;
  };
  for (const MatrixBackend* backend : matrixBackends()) {
    NetworkRun run;
    run.backend = backend;
    run.precision = FactorPrecision::kBfloat16;
    std::vector<float> out(c.rows * c.outputs);
    Linear(table, "fc", c.inputs, c.outputs).apply(run, c.rows, in.data(), out.data());
    // The same from bfloat16 as it lies in memory, which oneDNN reads in place.
    std::vector<uint16_t> halves(weight.size());
    scalarLayerKernel().narrow(weight.size(), weight.data(), halves.data());
    const std::map<std::string, WeightTensor> tensors = {
        {"fc.weight",
         {WeightType::kBfloat16,
          "BF16",
          {c.outputs, c.inputs},
          reinterpret_cast<const uint8_t*>(halves.data())}},
        {"fc.bias",
         {WeightType::kFloat32,
          "F32",
          {c.outputs},
          reinterpret_cast<const uint8_t*>(bias.data())}}};
    std::vector<float> in_place(out.size());
    Linear(WeightTable("memory", tensors, nullptr), "fc", c.inputs, c.outputs)
        .apply(run, c.rows, in.data(), in_place.data());
    if (backend->has(FactorPrecision::kBfloat16)) {
      EXPECT_EQ(in_place, out);
    }
    // A backend that has it not multiplies in float32.
    const bool has = backend->has(FactorPrecision::kBfloat16);
    expectProduct(c, has ? rounded(in) : in, c.inputs, has ? rounded(weight) : weight, bias, out,
                  c.outputs, 6e-8, backend->name());
  }
}

TEST(Linear, HasTheSameBitsForAnyNumberOfThreads) {
  const WeightTable table = TableBuilder()
                                .add("fc.weight", {700, 300}, numbers(700 * 300, 6))
                                .add("fc.bias", {700}, numbers(700, 7))
                                .table();
  const Linear linear(table, "fc", 300, 700);
  const std::vector<float> in = numbers(401 * 300, 8);
  for (const MatrixBackend* backend : matrixBackends()) {
    for (const FactorPrecision precision :
         {FactorPrecision::kFloat32, FactorPrecision::kBfloat16}) {
      std::vector<float> first;
      for (const unsigned threads : {1u, 2u, 5u}) {
        std::vector<float> out(401 * 700);
        NetworkRun run;
        run.backend = backend;
        run.precision = precision;
        withThreads(threads, [&] { linear.apply(run, 401, in.data(), out.data()); });
        if (first.empty()) first = out;
        EXPECT_EQ(out, first) << backend->name() << " " << threads;
      }
    }
  }
}

TEST(Linear, SaysWhatIsWrongWithItsTensors) {
  std::vector<float> weight = numbers(600 * 3, 1);
  weight[5 * 3 + 1] = std::numeric_limits<float>::infinity();
  const WeightTable table = TableBuilder()
                                .add("a.fc.weight", {600, 3}, weight)
                                .add("a.fc.bias", {599}, numbers(599, 2))
                                .table()
                                .under("a.");
  expectError(ErrorCode::kFormat, {"net.safetensors", "'a.fc.weight'", "[600, 3]", "[any, 4]"},
              [&] { Linear(table, "fc", 4, kAnySize); });
  expectError(ErrorCode::kFormat, {"'a.fc.bias'", "[599]", "[600]"},
              [&] { Linear(table, "fc", 3, 600); });
  expectError(ErrorCode::kFormat, {"'a.none.weight'"}, [&] { Linear(table, "none", 3, 600); });
  const Linear linear(table, "fc", 3, 600, LinearBias::kNone);
  const std::vector<float> in(3);
  std::vector<float> out(600);
  // Twice: a failure is not forgotten.
  for (int i = 0; i < 2; ++i) {
    expectError(ErrorCode::kFormat, {"'a.fc.weight'", "infinity", "number 16"},
                [&] { linear.apply({}, 1, in.data(), out.data()); });
  }
}

TEST(Linear, StopsWhenCancelled) {
  const WeightTable table = TableBuilder().add("w.weight", {4, 4}, numbers(16, 1)).table();
  const Linear linear(table, "w", 4, 4, LinearBias::kNone);
  Progress progress;
  progress.cancel();
  NetworkRun run;
  run.progress = &progress;
  const std::vector<float> in(4);
  std::vector<float> out(4);
  expectError(ErrorCode::kCancelled, {}, [&] { linear.apply(run, 1, in.data(), out.data()); });
}

}  // namespace
}  // namespace stipple
