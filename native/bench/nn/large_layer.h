#pragma once

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/random.h"
#include "nn/linear.h"
#include "nn/training/parameter_layout.h"

namespace stipple::bench {

/// Uniform in -size..size, keyed by the seed.
inline std::vector<float> layerNumbers(size_t count, uint64_t seed, float size) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = size * (2 * unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i)) - 1);
  }
  return made;
}

/// A layer that is only run, in float32 and by the backend that networks use: its rate is what
/// products may reach.
class LargeLayer {
 public:
  static constexpr size_t kRows = 2048, kWidth = 1024;
  static constexpr double kOperations = 2.0 * kRows * kWidth * kWidth;

  LargeLayer() {
    layout_.add("fc.weight", {kWidth, kWidth});
    auto values =
        std::make_shared<const std::vector<float>>(layerNumbers(layout_.size(), 1, 0.03f));
    layer_ = Linear(layout_.table("benchmark", std::move(values)), "fc", kWidth, kWidth,
                    LinearBias::kNone);
  }
  void run() {
    layer_.apply({}, kRows, in_.data(), out_.data());
    benchmark::DoNotOptimize(out_.data());
  }

 private:
  ParameterLayout layout_;
  Linear layer_;
  std::vector<float> in_ = layerNumbers(kRows * kWidth, 2, 1.0f);
  std::vector<float> out_ = std::vector<float>(kRows * kWidth);
};

}  // namespace stipple::bench
