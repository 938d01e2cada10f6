#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "bench/splat_views.h"
#include "train/loop/explicit_model.h"
#include "train/loop/trainer.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kCases[] = {
    {"15k_256x464", 15000, 256, 464, 0, 1.0},
    {"50k_800x800", 50000, 800, 800, 0, 1.0},
};
constexpr size_t kViews = 8;
constexpr uint64_t kSteps = 16;
constexpr int kRounds = 3;

std::unique_ptr<FitModel> modelOf(const ViewSource& views, const FitViews& split) {
  ExplicitModelOptions options;
  options.sh_degree = 0;
  return makeExplicitModel(*cpuBackends(), views, split.training, options);
}

/// Ends a fit after kSteps.
class Stop final : public FitObserver {
 public:
  explicit Stop(Progress& progress) : progress_(progress) {}
  void figures(const FitFigures& figures) override {
    if (figures.iteration >= kSteps) progress_.cancel();
  }

 private:
  Progress& progress_;
};

/// Seconds of kSteps steps of a trainer, pictures and books included.
double trainerSeconds(const std::shared_ptr<const ViewSource>& views) {
  const FitViews split = splitViews(*views, 0);
  TrainerOptions options;
  options.iterations = 30000;
  Trainer trainer(*cpuBackends(), views, split, modelOf(*views, split), options);
  Progress progress;
  Stop stop(progress);
  trainer.run(stop, &progress);
  double sum = 0;
  for (const FitRecord& r : trainer.history().records) {
    sum += static_cast<double>(r.render_seconds + r.backward_seconds + r.field_seconds +
                               r.optimiser_seconds + r.edit_seconds + r.other_seconds);
  }
  return sum;
}

/// The same steps by hand, with targets that are ready.
double bareSeconds(const std::shared_ptr<const ViewSource>& views) {
  const FitViews split = splitViews(*views, 0);
  const auto model = modelOf(*views, split);
  PictureStore pictures(views, UINT64_MAX);
  std::vector<TargetPicture> targets(kViews);
  const double black[3] = {0, 0, 0};
  for (size_t v = 0; v < kViews; ++v) pictures.load(v, black, targets[v]);
  FitMoment moment;
  ViewOrder order(kViews, 0);
  double sum = 0;
  for (uint64_t i = 0; i < kSteps; ++i) {
    moment.iteration = i + 1;
    StepView view;
    view.index = order.at(i);
    view.camera = &views->camera(view.index);
    view.target = targets[view.index].colour.data();
    sum += secondsOf([&] { model->step(moment, view, nullptr, nullptr); });
  }
  return sum;
}

void steps(benchmark::State& state, const SplatCase& c) {
  const auto views = viewsOf(c, kViews);
  double ours = 1e300, bare = 1e300;
  for (auto round : state) {
    (void)round;
    withThreads(2, [&] {
      bare = std::min(bare, bareSeconds(views));
      const double seconds = trainerSeconds(views);
      ours = std::min(ours, seconds);
      state.SetIterationTime(seconds);
    });
  }
  state.counters["step_ms"] = 1e3 * ours / kSteps;
  state.counters["reference_ms"] = 1e3 * bare / kSteps;
  state.counters["ratio_bare_steps"] = bare / ours;
}

const bool registered = [] {
  for (const SplatCase& c : kCases) {
    benchmark::RegisterBenchmark((std::string("trainer.step.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Iterations(kRounds)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
