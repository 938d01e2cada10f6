// Layers of networks at the sizes of the flow network: products of matrices against what the
// processor multiplies at most, layers and attention against those products, two threads against
// one; few rows, which memory limits, against a copy of the weights. All reference rates are of the
// same run.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/random.h"
#include "bench/comparison.h"
#include "bench/nn/multiply_peak.h"
#include "nn/attention.h"
#include "nn/linear.h"
#include "nn/matrix_backend.h"
#include "nn/shared_attention.h"

namespace stipple::bench {
namespace {

constexpr int kRepeats = 7;

std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> out(count);
  parallelFor(count, size_t{1} << 16, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      out[i] = 2.0f * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1.0f;
    }
  });
  return out;
}

/// A weight [outputs, inputs] of bfloat16 numbers, as the released networks have.
WeightTable weightOf(size_t inputs, size_t outputs) {
  auto halves = std::make_shared<std::vector<uint16_t>>(inputs * outputs);
  for (size_t i = 0; i < halves->size(); ++i) {
    // Signs and the upper bits of mantissas of numbers of 1/8 to 1/4.
    (*halves)[i] = static_cast<uint16_t>(0x3e00 | (i * 40503u & 0x807fu));
  }
  std::map<std::string, WeightTensor> tensors;
  tensors["fc.weight"] = {WeightType::kBfloat16,
                          "BF16",
                          {outputs, inputs},
                          reinterpret_cast<const uint8_t*>(halves->data())};
  return WeightTable("benchmark", std::move(tensors), halves);
}

const char* nameOf(FactorPrecision precision) {
  return precision == FactorPrecision::kBfloat16 ? "bf16" : "f32";
}

/// One product of a backend, packed outside the clock, whose operands stay in the caches: what its
/// layers are compared with.
class BareProduct {
 public:
  static constexpr size_t kRows = 192, kInputs = 1024, kOutputs = 256;
  static constexpr double kOperations = 2.0 * kRows * kInputs * kOutputs;

  BareProduct(const MatrixBackend& backend, FactorPrecision precision)
      : backend_(backend),
        precision_(precision),
        in_(numbers(kRows * kInputs, 1)),
        out_(kRows * kOutputs),
        packed_(backend.packedSize(kInputs, kOutputs, precision) + kLine) {
    const WeightTable table = weightOf(kInputs, kOutputs);
    backend.pack(table.require("fc.weight", {kOutputs, kInputs}), kInputs, 0, kOutputs, precision,
                 packed());
  }
  void multiply() {
    LinearPanel panel;
    panel.rows = kRows;
    panel.inputs = kInputs;
    panel.outputs = kOutputs;
    panel.in = in_.data();
    panel.in_stride = kInputs;
    panel.out = out_.data();
    panel.out_stride = kOutputs;
    backend_.multiply(panel, packed(), precision_);
  }
  /// The best of some in a row.
  double operationsPerSecond() {
    double best = 1e300;
    for (int i = 0; i < kRepeats; ++i) best = std::min(best, secondsOf([&] { multiply(); }));
    return kOperations / best;
  }

 private:
  static constexpr size_t kLine = 16;
  float* packed() {
    void* memory = packed_.data();
    size_t room = packed_.size() * sizeof(float);
    return static_cast<float*>(
        std::align(64, (packed_.size() - kLine) * sizeof(float), memory, room));
  }
  const MatrixBackend& backend_;
  FactorPrecision precision_;
  std::vector<float> in_, out_, packed_;
};

void multiplyOnce(benchmark::State& state, const MatrixBackend& backend,
                  FactorPrecision precision) {
  BareProduct product(backend, precision);
  product.multiply();
  double best = 0, peak = 0;
  for (auto step : state) {
    (void)step;
    peak = std::max(peak, peakOperationsPerSecond());
    const double rate = product.operationsPerSecond();
    best = std::max(best, rate);
    state.SetIterationTime(BareProduct::kOperations / rate);
  }
  state.counters["gflops"] = 1e-9 * best;
  state.counters["peak_gflops"] = 1e-9 * peak;
  state.counters["ratio_peak"] = best / peak;
  state.SetLabel(backend.instructionSets() + ", peak " + peakTarget());
}

/// Runs `work`, of so many operations, on one thread and on two by turns, with the bare product and
/// the peak between.
template <class Work>
void compareWithProduct(benchmark::State& state, const MatrixBackend& backend,
                        FactorPrecision precision, double operations, const Work& work) {
  BareProduct product(backend, precision);
  double one = 1e300, two = 1e300, rate = 0, peak = 0;
  work();
  for (auto step : state) {
    (void)step;
    peak = std::max(peak, peakOperationsPerSecond());
    rate = std::max(rate, product.operationsPerSecond());
    double seconds = 0;
    withThreads(1, [&] { seconds = secondsOf(work); });
    one = std::min(one, seconds);
    state.SetIterationTime(seconds);
    withThreads(2, [&] { seconds = secondsOf(work); });
    two = std::min(two, seconds);
  }
  state.counters["best_ms"] = 1e3 * one;
  state.counters["gflops"] = 1e-9 * operations / one;
  state.counters["ratio_product"] = operations / one / rate;
  state.counters["ratio_peak"] = operations / one / peak;
  state.counters["ratio_one_thread"] = one / two;
  state.SetLabel(backend.instructionSets());
}

struct LinearCase {
  size_t rows, inputs, outputs;
};

void linear(benchmark::State& state, const MatrixBackend& backend, FactorPrecision precision,
            const LinearCase& c) {
  const WeightTable table = weightOf(c.inputs, c.outputs);
  const Linear layer(table, "fc", c.inputs, c.outputs, LinearBias::kNone);
  const std::vector<float> in = numbers(c.rows * c.inputs, 1);
  std::vector<float> out(c.rows * c.outputs);
  NetworkRun run;
  run.backend = &backend;
  run.precision = precision;
  const double operations = 2.0 * static_cast<double>(c.rows * c.inputs * c.outputs);
  compareWithProduct(state, backend, precision, operations,
                     [&] { layer.apply(run, c.rows, in.data(), out.data()); });
}

void attend(benchmark::State& state, const MatrixBackend& backend, FactorPrecision precision,
            const AttentionShape& shape) {
  const size_t width = shape.heads * shape.head_width;
  // Queries, keys and values side by side, as one layer makes them.
  const std::vector<float> qkv = numbers(shape.keys * 3 * width, 1);
  std::vector<float> out(shape.queries * width);
  const double operations =
      4.0 * static_cast<double>(shape.heads * shape.head_width * shape.queries * shape.keys);
  NetworkRun run;
  run.backend = &backend;
  run.precision = precision;
  compareWithProduct(state, backend, precision, operations, [&] {
    attention(run, shape, {qkv.data(), 3 * width}, {qkv.data() + width, 3 * width},
              {qkv.data() + 2 * width, 3 * width}, out.data(), width);
  });
}

/// Few rows go through layers that are too many for any cache, on two threads, against a copy of
/// what is read of their weights.
void fewRows(benchmark::State& state, size_t rows) {
  constexpr size_t kLayers = 16, kInputs = 1024, kOutputs = 4096;
  constexpr size_t kBytes = kLayers * kInputs * kOutputs * sizeof(uint16_t);
  constexpr size_t kPiece = size_t{1} << 20;
  std::vector<WeightTable> tables;
  std::vector<Linear> layers;
  for (size_t i = 0; i < kLayers; ++i) {
    tables.push_back(weightOf(kInputs, kOutputs));
    layers.emplace_back(tables.back(), "fc", kInputs, kOutputs, LinearBias::kNone);
  }
  const std::vector<float> in = numbers(rows * kInputs, 1);
  std::vector<float> out(rows * kOutputs);
  const auto ours = [&] {
    for (const Linear& layer : layers) layer.apply({}, rows, in.data(), out.data());
  };
  const std::vector<uint8_t> from(kBytes, 1);
  std::vector<uint8_t> to(kBytes);
  const auto copy = [&] {
    parallelFor(kBytes / kPiece, 1, [&](size_t begin, size_t) {
      std::memcpy(&to[begin * kPiece], &from[begin * kPiece], kPiece);
    });
  };
  withThreads(2, [&] {
    ours();
    compare(state, "copy", ours, copy);
  });
  state.SetLabel(matrixBackends().front()->instructionSets());
}

/// Queries of 16 heads of 64 meet rows of 16 numbers.
void attendShared(benchmark::State& state, size_t queries, size_t row_count) {
  constexpr size_t kHeads = 16, kWidth = 64, kRowWidth = 16;
  const std::vector<float> maps = numbers(kHeads * kWidth * (kRowWidth + 1), 1);
  const std::vector<float> rates(kHeads * row_count, 0.1f);
  const std::vector<float> values = numbers(row_count * kRowWidth, 2);
  const std::vector<float> q = numbers(queries * kHeads * kWidth, 3);
  std::vector<float> out(q.size());
  const SharedRows rows(row_count, kRowWidth, values.data());
  const SharedHeads heads = {kHeads, kWidth, maps, maps, rates};
  const double operations =
      2.0 * (2 * kRowWidth + 1) * static_cast<double>(kHeads * queries * row_count);
  compareWithProduct(state, *matrixBackends().front(), FactorPrecision::kFloat32, operations, [&] {
    sharedAttention({}, heads, rows, queries, q.data(), kHeads * kWidth, out.data());
  });
}

template <class Function>
void add(const std::string& name, const Function& function) {
  benchmark::RegisterBenchmark(name.c_str(), function)
      ->UseManualTime()
      ->Iterations(kRepeats)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  for (const size_t rows : {1, 32}) {
    add("nn.few_rows." + std::to_string(rows) + "x1024x4096",
        [=](benchmark::State& state) { fewRows(state, rows); });
  }
  for (const size_t queries : {32, 1024}) {
    add("nn.shared_attention." + std::to_string(queries) + "x8192_16x64",
        [=](benchmark::State& state) { attendShared(state, queries, 8192); });
  }
  for (const MatrixBackend* backend : matrixBackends()) {
    for (const FactorPrecision precision :
         {FactorPrecision::kFloat32, FactorPrecision::kBfloat16}) {
      if (!backend->has(precision)) continue;
      const std::string kind = std::string(backend->name()) + "_" + nameOf(precision);
      add("nn.product_" + kind + ".192x1024x256",
          [=](benchmark::State& state) { multiplyOnce(state, *backend, precision); });
      const LinearCase cases[] = {{4096, 1024, 3072}, {4096, 1024, 4096}, {4096, 4096, 1024}};
      for (const LinearCase& c : cases) {
        add("nn.linear_" + kind + "." + std::to_string(c.rows) + "x" + std::to_string(c.inputs) +
                "x" + std::to_string(c.outputs),
            [=](benchmark::State& state) { linear(state, *backend, precision, c); });
      }
      // Attention in float32 goes through our own kernels, whatever the backend.
      if (precision == FactorPrecision::kFloat32 && backend != matrixBackends().front()) continue;
      const AttentionShape shapes[] = {{16, 64, 4096, 4096}, {1, 512, 4096, 4096}};
      for (const AttentionShape& shape : shapes) {
        add("nn.attention_" + kind + ".4096x4096_" + std::to_string(shape.heads) + "x" +
                std::to_string(shape.head_width),
            [=](benchmark::State& state) { attend(state, *backend, precision, shape); });
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
