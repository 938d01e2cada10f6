// Whole iterations of a fit of explicit splats against the bare passes of its backend, and what an
// edit of density control costs beside the iterations between two of them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "densify/strategies.h"
#include "train/explicit_model.h"
#include "train/render_backend.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kStepCases[] = {
    {"15k_256x464", 15000, 256, 464, 0, 1.0},
    {"150k_800x800", 150000, 800, 800, 3, 1.0},
};
constexpr SplatCase kEventCase = {"300k", 300000, 800, 800, 3, 1.0};
constexpr int kRounds = 8;

/// The case's own picture over black, a little darker.
std::vector<float> targetOf(const SplatCase& c) {
  const SplatInstance instance{&cloudOf(c)};
  const RenderResult drawn = renderTiled({&instance, 1}, cameraOf(c), {});
  std::vector<float> target;
  for (size_t i = 0; i < drawn.colour.size(); ++i) {
    if (i % 4 < 3) target.push_back(0.9f * drawn.colour[i]);
  }
  return target;
}

/// One view again and again.
class OneView {
 public:
  explicit OneView(const SplatCase& c) : camera_(cameraOf(c)), target_(targetOf(c)) {
    view_.camera = &camera_;
    view_.target = target_.data();
    moment_.extent = 1e-3;  // so that positions stay what they are
  }

  StepReport step(FitModel& model, uint64_t iteration, uint64_t iterations) {
    moment_.iteration = iteration;
    moment_.iterations = iterations;
    return model.step(moment_, view_, nullptr, nullptr);
  }
  const Camera& camera() const { return camera_; }
  const std::vector<float>& target() const { return target_; }

 private:
  Camera camera_;
  std::vector<float> target_;
  StepView view_;
  FitMoment moment_;
};

/// In the window of density control, so that statistics are gathered, and between its edits.
void steps(benchmark::State& state, const SplatCase& c) {
  OneView view(c);
  ExplicitModelOptions options;
  options.sh_degree = c.degree;
  const auto model = makeExplicitModel(cloudOf(c), makeStrategy("adaptive"), options);
  const auto backend = makeCpuBackend();
  backend->upload(cloudOf(c));
  RenderOptions render;
  render.with_depth = false;
  render.with_background = true;
  StepOptions step;
  step.learning_rates.fill(1e-9);
  uint64_t iteration = 200000;  // every degree is drawn
  withThreads(2, [&] {
    compare(
        state, "passes", 0.95, [&] { view.step(*model, ++iteration, 1000000); },
        [&] {
          backend->forward(view.camera(), render);
          backend->loss(view.target(), {});
          backend->backward({});
          backend->step(step);
        });
  });
}

/// A twentieth more splats and all faint ones less, against 100 iterations.
void densifyEvent(benchmark::State& state) {
  const SplatCase& c = kEventCase;
  OneView view(c);
  ExplicitModelOptions options;
  options.sh_degree = c.degree;
  options.max_splats = c.splats + c.splats / 20;
  const char* everything = "adaptive(threshold=1e-9)";
  const auto model = makeExplicitModel(cloudOf(c), makeStrategy(everything), options);
  double best_step = 1e300, best_event = 1e300;
  withThreads(2, [&] {
    view.step(*model, 598, 30000);
    const TensorTable saved = model->state();
    for (auto round : state) {
      (void)round;
      model->restore(saved);
      view.step(*model, 598, 30000);
      best_step = std::min(best_step, secondsOf([&] { view.step(*model, 599, 30000); }));
      const double seconds = view.step(*model, 600, 30000).seconds.edit;
      state.SetIterationTime(seconds);
      best_event = std::min(best_event, seconds);
    }
  });
  state.counters["best_ms"] = 1e3 * best_event;
  state.counters["reference_ms"] = 1e5 * best_step;
  state.counters["ratio_100_iterations"] = 100 * best_step / best_event;
  state.counters["target_100_iterations"] = 50;
}

const bool registered = [] {
  for (const SplatCase& c : kStepCases) {
    benchmark::RegisterBenchmark((std::string("train.step.explicit.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Iterations(kRounds)
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::RegisterBenchmark("train.densify_event.300k", densifyEvent)
      ->UseManualTime()
      ->Iterations(3)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace stipple::bench
