// The way back of networks at the sizes of the small configuration: all products that a network's
// step needs, at the rate of large layers in the same run, against the step.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <vector>

#include "bench/comparison.h"
#include "bench/nn/large_layer.h"
#include "train/networks/trained_gaussians.h"

namespace stipple::bench {
namespace {

constexpr int kRepeats = 7;
constexpr size_t kWidth = 256, kHeads = 8, kBlocks = 4, kLatent = 16;
constexpr uint32_t kGaussians = 8;

/// Of `rows` tokens through linear layers with so many weights for each: forward, once more when a
/// block is run again, and twice on the way back.
double linearOperations(double rows, double weights) {
  return 4 * 2 * rows * weights;
}

/// Of an attention: two products forward, twice, and five on the way back.
double attentionOperations(double queries, double keys) {
  return 9 * 2 * queries * keys * kWidth;
}

/// The network of splats: anchors that look at each other and at a latent.
void splats(benchmark::State& state) {
  const auto rows = static_cast<size_t>(state.range(0)), tokens = static_cast<size_t>(256);
  ParameterLayout layout;
  const TrainedGaussians network(layout, "gs.", {kHeads, kWidth / kHeads, kLatent, kBlocks, 4},
                                 kGaussians);
  const std::vector<float> values = layerNumbers(layout.size(), 3, 0.06f);
  const std::vector<float> latent = layerNumbers(tokens * kLatent, 4, 1.0f);
  std::vector<float> points = layerNumbers(rows * 3, 5, 0.5f);
  for (float& value : points) value += 0.5f;
  std::vector<float> gradients(layout.size()), by_latent(latent.size());
  const ContextRows context = {tokens, latent.data()};
  LargeLayer layer;
  const auto count = static_cast<double>(rows);
  const double operations = kBlocks * (linearOperations(count, 14.0 * kWidth * kWidth) +
                                       attentionOperations(count, count) +
                                       attentionOperations(count, static_cast<double>(tokens)));
  compare(
      state, "large_layer",
      [&] {
        TrainedGaussians::Tape tape;
        const std::vector<float> made = network.forward(values, context, rows, points.data(), tape);
        network.backward(values, context, rows, points.data(), tape, made, gradients,
                         by_latent.data());
        benchmark::DoNotOptimize(gradients.data());
      },
      [&] { layer.run(); }, LargeLayer::kOperations / operations);
  state.counters["GFLOP"] = 1e-9 * operations;
}

BENCHMARK(splats)
    ->Name("nn.training_splats")
    ->Arg(256)
    ->Arg(1024)
    ->Iterations(kRepeats)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
