// Whole iterations of a fit of anchors with features, split by what they do: against the passes of
// the splats that they make.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "bench/anchors/ball_views.h"
#include "bench/comparison.h"
#include "splat/render/render.h"
#include "train/anchors/scaffold_model.h"
#include "train/backend/render_backend.h"

namespace stipple::bench {
namespace {

struct ScaffoldCase {
  const char* name;
  uint64_t anchors;
  uint32_t size;  ///< pixels a side
};
constexpr ScaffoldCase kCases[] = {{"2k_256x256", 2048, 256}, {"8k_512x512", 8192, 512}};
constexpr int kSteps = 10;

void steps(benchmark::State& state, const ScaffoldCase& c) {
  const BallViews ball(c.anchors, c.size);
  ScaffoldModelOptions fit;
  fit.most_anchors = fit.start_anchors = c.anchors;
  fit.sh_degree = 2;
  const std::vector<size_t> training = {0};
  const auto model = makeScaffoldModel(*cpuBackends(), ball.views(), training, fit);
  StatisticRequest request;
  request.screen_gradients = true;
  const ExplicitPasses passes(ball, model->splats(0), request);
  // In the stage that gathers statistics, between two events.
  uint64_t iteration = 10001;
  StepSeconds least;
  double best = 1e300, best_passes = 1e300;
  const auto step = [&] {
    FitMoment moment;
    moment.iteration = iteration;
    moment.iterations = 30000;
    StepView view;
    view.camera = &ball.views().camera(0);
    view.target = ball.picture().colour.data();
    return model->step(moment, view, nullptr, nullptr);
  };
  step();
  passes();
  for (auto round : state) {
    (void)round;
    ++iteration;
    StepReport report;
    const double seconds = secondsOf([&] { report = step(); });
    state.SetIterationTime(seconds);
    if (seconds < best) least = report.seconds;
    best = std::min(best, seconds);
    best_passes = std::min(best_passes, secondsOf(passes));
  }
  state.counters["step_ms"] = 1e3 * best;
  state.counters["render_ms"] = 1e3 * least.render;
  state.counters["backward_ms"] = 1e3 * least.backward;
  state.counters["field_ms"] = 1e3 * least.field;
  state.counters["optimiser_ms"] = 1e3 * least.optimiser;
  state.counters["edit_ms"] = 1e3 * least.edit;
  state.counters["passes_ms"] = 1e3 * best_passes;
  state.counters["ratio_explicit_passes"] = best_passes / best;
}

const bool kRegistered = [] {
  for (const ScaffoldCase& c : kCases) {
    benchmark::RegisterBenchmark((std::string("train.step.scaffold.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond)
        ->Iterations(kSteps);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
