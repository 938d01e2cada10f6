#include <benchmark/benchmark.h>

#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "splat/cpu/tile.h"
#include "splat/cpu/tiled_backward.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kCases[] = {{"15k_256x464", 15000, 256, 464, 0, 1.0},
                                {"150k_800x800", 150000, 800, 800, 3, 1.0}};
constexpr int kRepeats = 5;

/// What the backward pass is given: derivatives and residuals without a pattern.
struct Loss {
  std::vector<float> gradient;
  std::vector<float> residual;

  explicit Loss(const SplatCase& c) {
    std::mt19937 random(2);
    std::uniform_real_distribution<float> uniform(-1.0f, 1.0f);
    const size_t pixels = static_cast<size_t>(c.width) * c.height;
    gradient.resize(pixels * 4);
    residual.resize(pixels * 3);
    for (float& value : gradient) value = uniform(random);
    for (float& value : residual) value = 0.1f * uniform(random);
  }
  BackwardInput input(BackwardMode mode) const {
    BackwardInput input;
    input.colour_gradient = gradient;
    if (mode != BackwardMode::kGradients) input.residual = residual;
    if (mode == BackwardMode::kStatistics) {
      input.with_blending_weights = input.with_screen_gradients = true;
    }
    return input;
  }
};

void takeOffAll(const SplatCase& c, const BackwardKernel& kernel, const BackwardInput& input,
                unsigned threads) {
  const SplatInstance instance{&cloudOf(c)};
  withThreads(threads, [&] {
    // As in training: the memory of the last step serves the next.
    static BackwardWorkspace workspace;
    static BackwardResult result;
    renderBackwardWith(kernel, {&instance, 1}, cameraOf(c), {}, input, workspace, result);
    benchmark::DoNotOptimize(result.camera.data());
  });
}

void draw(const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  withThreads(2, [&] {
    static RenderWorkspace workspace;
    static RenderResult picture;
    renderTiled({&instance, 1}, cameraOf(c), {}, workspace, picture);
    benchmark::DoNotOptimize(picture.colour.data());
  });
}

/// The two loops alone, one thread, splats made ready outside the clock.
struct LoopTimes {
  double mark = 1e300;  ///< seconds
  double take_off = 1e300;
  double listed = 0;  ///< pixel-splat pairs of the lists
  double blended = 0;
};

LoopTimes measureLoops(const SplatCase& c, const BackwardKernel& kernel, const Loss& loss,
                       BackwardMode mode) {
  const SplatInstance instance{&cloudOf(c)};
  RenderOptions options;
  options.with_counts = true;
  LoopTimes times;
  for (const uint32_t n : renderTiled({&instance, 1}, cameraOf(c), options).counts) {
    times.blended += n;
  }
  const PlacedScene scene = placeScene({&instance, 1}, cameraOf(c), {});
  const VisibleSplats visible = findVisibleSplats(scene, nullptr);
  const TileGrid grid(c.width, c.height);
  const auto pixels = std::make_unique<BackwardPixels>();
  std::vector<BackwardSplat> splats;
  std::vector<float> sums;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    double mark = 0;
    double take_off = 0;
    times.listed = 0;
    forEachTileGroup(visible, grid, nullptr, [&](const TileListGroup& group) {
      for (size_t index = group.first_tile; index < group.end_tile; ++index) {
        const Tile tile = tileOf(grid, index, group.tile(index));
        splats.clear();
        for (const uint32_t i : tile.splats) {
          splats.push_back({makeTileSplat(visible.splats[i], tile), 0});
        }
        sums.resize(splats.size() * backwardFieldCount(mode));
        *pixels = {};
        for (uint32_t i = 0; i < kTilePixelCount; ++i) {
          const bool inside = i % kTileSide < tile.width && i / kTileSide < tile.height;
          pixels->transmittance[i] = 1.0f;
          pixels->cut[i] = inside ? kLog2MinAlpha : kFinished;
          pixels->last[i] = -1;
          for (size_t channel = 0; channel < 4; ++channel) {
            pixels->gradient[channel][i] = loss.gradient[i * 4 + channel];
          }
          for (size_t channel = 0; channel < 3; ++channel) {
            const float residual = loss.residual[i * 3 + channel];
            pixels->signed_weight[channel][i] = residual < 0 ? -1.0f : 1.0f;
            pixels->room[channel][i] = 2.0f * std::abs(residual);
          }
        }
        pixels->unfinished = tile.width * tile.height;
        mark += secondsOf([&] { kernel.mark(splats.data(), splats.size(), 0, *pixels); });
        take_off += secondsOf(
            [&] { kernel.take_off(splats.data(), splats.size(), 0, mode, *pixels, sums.data()); });
        times.listed += static_cast<double>(splats.size()) * kTilePixelCount;
      }
    });
    times.mark = std::min(times.mark, mark);
    times.take_off = std::min(times.take_off, take_off);
  }
  return times;
}

/// The whole call over its two loops on the same lists, and over a forward call in the same run.
void againstFloor(benchmark::State& state, const SplatCase& c, BackwardMode mode) {
  const Loss loss(c);
  const BackwardInput input = loss.input(mode);
  const BackwardKernel& kernel = chosenBackwardKernel();
  takeOffAll(c, kernel, input, 2);
  draw(c);
  double best = 1e300;
  double forward = 1e300;
  for (auto step : state) {
    (void)step;
    forward = std::min(forward, secondsOf([&] { draw(c); }));
    const double seconds = secondsOf([&] { takeOffAll(c, kernel, input, 2); });
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  const LoopTimes loops = measureLoops(c, kernel, loss, mode);
  const double floor = (loops.mark + loops.take_off) / 2;
  state.counters["best_ms"] = 1e3 * best;
  state.counters["forward_ms"] = 1e3 * forward;
  state.counters["mark_1_thread_ms"] = 1e3 * loops.mark;
  state.counters["take_off_1_thread_ms"] = 1e3 * loops.take_off;
  state.counters["ns_per_listed_pair"] = 1e9 * loops.take_off / loops.listed;
  state.counters["ns_per_blended_pair"] = 1e9 * loops.take_off / loops.blended;
  state.counters["ratio_floor"] = best / floor;
  state.counters["limit_floor"] = 2.0;
  state.counters["ratio_forward"] = best / forward;
  if (mode == BackwardMode::kContributions) {
    const LoopTimes plain = measureLoops(c, kernel, loss, BackwardMode::kGradients);
    state.counters["ratio_ns_more_per_listed_pair"] =
        1e9 * (loops.take_off - plain.take_off) / loops.listed;
    state.counters["limit_ns_more_per_listed_pair"] = 0.40;
    state.counters["ns_more_per_blended_pair"] =
        1e9 * (loops.take_off - plain.take_off) / loops.blended;
  }
}

void againstOneThread(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  const BackwardInput input = loss.input(BackwardMode::kGradients);
  cloudOf(c);
  compare(
      state, "one_thread", 1.8, [&] { takeOffAll(c, chosenBackwardKernel(), input, 2); },
      [&] { takeOffAll(c, chosenBackwardKernel(), input, 1); });
}

/// AVX2 over the best instruction set, the loops alone.
void againstNarrow(benchmark::State& state, const SplatCase& c) {
  const Loss loss(c);
  const BackwardKernel wide = chosenBackwardKernel();
  for (const BackwardKernel& narrow : backwardKernels()) {
    if (std::string(narrow.target) != "AVX2" || narrow.mark == wide.mark) continue;
    double wide_seconds = 1e300;
    double narrow_seconds = 1e300;
    for (auto step : state) {
      (void)step;
      const LoopTimes a = measureLoops(c, wide, loss, BackwardMode::kGradients);
      const LoopTimes b = measureLoops(c, narrow, loss, BackwardMode::kGradients);
      wide_seconds = std::min(wide_seconds, a.mark + a.take_off);
      narrow_seconds = std::min(narrow_seconds, b.mark + b.take_off);
      state.SetIterationTime(b.mark + b.take_off);
    }
    state.counters["best_ms"] = 1e3 * wide_seconds;
    state.counters["avx2_ms"] = 1e3 * narrow_seconds;
    state.counters["ratio_avx2_throughput"] = wide_seconds / narrow_seconds;
    state.counters["target_avx2_throughput"] = 0.5;
    return;
  }
  state.SkipWithError("this processor has no wider instruction set than AVX2");
}

template <typename... Arguments>
void add(const std::string& name, int iterations, Arguments... arguments) {
  benchmark::RegisterBenchmark(name.c_str(), arguments...)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  for (const SplatCase& c : kCases) {
    const std::string name = c.name;
    add("splat.backward." + name, kRepeats, againstFloor, c, BackwardMode::kGradients);
    add("splat.backward_contributions." + name, kRepeats, againstFloor, c,
        BackwardMode::kContributions);
    add("splat.backward_statistics." + name, kRepeats, againstFloor, c, BackwardMode::kStatistics);
    add("splat.backward_2_threads." + name, kRepeats, againstOneThread, c);
    add("splat.backward_avx2." + name, 1, againstNarrow, c);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
