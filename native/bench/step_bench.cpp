#include <benchmark/benchmark.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "train/backend/render_backend.h"

namespace stipple::bench {
namespace {

// A fit's start, the same early in it, when splats are large, and a scene of middle size.
constexpr SplatCase kCases[] = {
    {"small.15k_256x464", 15000, 256, 464, 0, 1.0},
    {"large.15k_256x464", 15000, 256, 464, 0, 3.0},
    {"small.150k_800x800", 150000, 800, 800, 3, 1.0},
    {"large.150k_800x800", 150000, 800, 800, 3, 3.0},
    {"small.500k_1280x720", 500000, 1280, 720, 2, 1.0},
};
constexpr int kSteps = 8;

constexpr const char* kPasses[] = {"forward", "loss", "backward", "adam"};
constexpr size_t kPassCount = std::size(kPasses);

/// Seconds of each pass and of whole steps, the least of several.
struct StepTimes {
  double passes[kPassCount];
  double whole = 1e300;
  StepTimes() { std::fill(passes, passes + kPassCount, 1e300); }
};

/// A fit of the scene to its own picture, a little darker.
std::unique_ptr<RenderBackend> startFit(const SplatCase& c, const RenderOptions& options) {
  auto backend = makeCpuBackend();
  backend->upload(cloudOf(c));
  backend->forward(cameraOf(c), options);
  const std::vector<float> picture = backend->picture();
  std::vector<float> target;
  target.reserve(picture.size() / 4 * 3);
  for (size_t i = 0; i < picture.size(); ++i) {
    if (i % 4 < 3) target.push_back(0.9f * picture[i]);
  }
  backend->addTarget(c.width, c.height, target);
  return backend;
}

void takeStep(RenderBackend& backend, const SplatCase& c, const RenderOptions& options,
              StepTimes& times) {
  StepOptions step;
  // So small that the scene stays what it is.
  step.learning_rates.fill(1e-9);
  const double passes[kPassCount] = {secondsOf([&] { backend.forward(cameraOf(c), options); }),
                                     secondsOf([&] { backend.loss(0, {}); }),
                                     secondsOf([&] { backend.backward({}); }),
                                     secondsOf([&] { backend.step(step); })};
  double whole = 0;
  for (size_t i = 0; i < kPassCount; ++i) {
    times.passes[i] = std::min(times.passes[i], passes[i]);
    whole += passes[i];
  }
  times.whole = std::min(times.whole, whole);
}

/// Whole steps and their split, and against one thread.
void steps(benchmark::State& state, const SplatCase& c) {
  RenderOptions options;
  options.with_depth = false;
  const auto backend = startFit(c, options);
  StepTimes two, one;
  for (const unsigned threads : {2u, 1u}) {
    StepTimes unused;
    withThreads(threads, [&] { takeStep(*backend, c, options, unused); });
  }
  for (auto step : state) {
    (void)step;
    const double seconds =
        secondsOf([&] { withThreads(2, [&] { takeStep(*backend, c, options, two); }); });
    state.SetIterationTime(seconds);
    withThreads(1, [&] { takeStep(*backend, c, options, one); });
  }
  for (size_t i = 0; i < kPassCount; ++i) {
    state.counters[std::string(kPasses[i]) + "_ms"] = 1e3 * two.passes[i];
  }
  state.counters["step_ms"] = 1e3 * two.whole;
  state.counters["ratio_one_thread"] = one.whole / two.whole;
}

const bool registered = [] {
  for (const SplatCase& c : kCases) {
    benchmark::RegisterBenchmark((std::string("splat.step.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Iterations(kSteps)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
