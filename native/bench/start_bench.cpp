#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "bench/splat_views.h"
#include "train/loop/fit_model.h"
#include "train/prior/swept_points.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kCase = {"20_views", 15000, 256, 256, 0, 1.0};
constexpr size_t kViews = 20;
constexpr uint64_t kPoints = 30000;
/// What a point costs at most: 48 depths and 6 around the best, 6 neighbours, patches of 9.
constexpr uint64_t kTaps = 54 * 6 * 9;
constexpr int kRounds = 3;

/// Bilinear values of pictures of 256 x 256 x 4 floats alone, as many as a sweep takes.
float plainTaps(const std::vector<float>& picture) {
  std::vector<float> sums(kPoints);
  parallelFor(kPoints, 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float sum[4] = {0, 0, 0, 0};
      uint32_t at = static_cast<uint32_t>(i * 2654435761u);
      for (uint64_t k = 0; k < kTaps; ++k) {
        // A patch stays together, the next one is a pixel away.
        if (k % 9 == 0) at += 257;
        const size_t pixel = (at + (k % 9) / 3 * 256 + k % 3) % (255 * 256 - 1);
        const float u = static_cast<float>(k % 7) / 7, v = static_cast<float>(k % 5) / 5;
        const float* a = &picture[pixel * 4];
        for (size_t c = 0; c < 4; ++c) {
          const float upper = a[c] + u * (a[c + 4] - a[c]);
          const float lower = a[c + 1024] + u * (a[c + 1028] - a[c + 1024]);
          sum[c] += upper + v * (lower - upper);
        }
      }
      sums[i] = sum[0] + sum[1] + sum[2] + sum[3];
    }
  });
  return sums[kPoints / 2];
}

void sweep(benchmark::State& state) {
  const auto views = viewsOf(kCase, kViews);
  std::vector<size_t> training(kViews);
  for (size_t v = 0; v < kViews; ++v) training[v] = v;
  const std::vector<float> picture(256 * 257 * 4, 0.5f);
  double ours = 1e300, plain = 1e300;
  for (auto round : state) {
    (void)round;
    withThreads(2, [&] {
      plain = std::min(plain, secondsOf([&] { benchmark::DoNotOptimize(plainTaps(picture)); }));
      const double seconds = secondsOf(
          [&] { benchmark::DoNotOptimize(sweptPoints(*views, training, {kPoints}).size()); });
      ours = std::min(ours, seconds);
      state.SetIterationTime(seconds);
    });
  }
  state.counters["start_ms"] = 1e3 * ours;
  state.counters["reference_ms"] = 1e3 * plain;
  state.counters["ratio_plain_taps"] = plain / ours;
}

const bool registered = [] {
  benchmark::RegisterBenchmark("train.start.pictures_30k", sweep)
      ->UseManualTime()
      ->Iterations(kRounds)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace stipple::bench
