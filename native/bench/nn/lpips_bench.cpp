// LPIPS of two images by VGG16, against a large layer of the same run that multiplies as much.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>

#include "bench/comparison.h"
#include "bench/nn/large_layer.h"
#include "measure/perceptual_distance.h"

namespace stipple::bench {
namespace {

constexpr int kRepeats = 5;

/// Weights of VGG16's shapes; their values do not change the time.
WeightTable vggWeights() {
  constexpr uint64_t kChannels[] = {3,   64,  64,  128, 128, 256, 256,
                                    256, 512, 512, 512, 512, 512, 512};
  constexpr int kNumbers[] = {0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28};
  constexpr int kStages[] = {1, 1, 2, 2, 3, 3, 3, 4, 4, 4, 5, 5, 5};
  ParameterLayout layout;
  for (size_t i = 0; i < 13; ++i) {
    const std::string name =
        "net.slice" + std::to_string(kStages[i]) + "." + std::to_string(kNumbers[i]);
    layout.add(name + ".weight", {kChannels[i + 1], kChannels[i], 3, 3});
    layout.add(name + ".bias", {kChannels[i + 1]});
    if (i + 1 == 13 || kStages[i + 1] != kStages[i]) {
      layout.add("lin" + std::to_string(kStages[i] - 1) + ".model.1.weight",
                 {1, kChannels[i + 1], 1, 1});
    }
  }
  auto values = std::make_shared<const std::vector<float>>(layerNumbers(layout.size(), 1, 0.03f));
  return layout.table("benchmark", std::move(values));
}

Image noise(uint32_t width, uint32_t height, uint64_t seed) {
  Image image;
  image.width = width;
  image.height = height;
  image.channels = 3;
  image.transfer = Transfer::kSrgb;
  image.pixels = layerNumbers(image.pixelCount() * 3, seed, 0.5f);
  for (float& value : image.pixels) value += 0.5f;
  return image;
}

void distance(benchmark::State& state) {
  const PerceptualDistance measure(vggWeights());
  const Image a = noise(320, 180, 2), b = noise(320, 180, 3);
  LargeLayer layer;
  const double operations = 2 * measure.flops(a.height, a.width);
  compare(
      state, "large_layer", [&] { benchmark::DoNotOptimize(measure.between({}, a, b)); },
      [&] { layer.run(); }, LargeLayer::kOperations / operations);
  state.counters["GFLOP"] = 1e-9 * operations;
}

BENCHMARK(distance)
    ->Name("measure.lpips_vgg16.180p")
    ->Iterations(kRepeats)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stipple::bench
