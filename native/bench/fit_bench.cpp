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
#include "data/views/memory_view_source.h"
#include "densify/strategies.h"
#include "train/backend/render_backend.h"
#include "train/loop/explicit_model.h"
#include "train/loop/picture_store.h"
#include "train/loop/view_evaluator.h"

namespace stipple::bench {
namespace {

constexpr SplatCase kStepCases[] = {
    {"15k_256x464", 15000, 256, 464, 0, 1.0},
    {"150k_800x800", 150000, 800, 800, 3, 1.0},
};
constexpr SplatCase kEventCase = {"300k", 300000, 800, 800, 3, 1.0};
constexpr int kRounds = 8;
constexpr size_t kEventViews = 10;

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
    moment_.view_count = kEventViews;
  }

  StepReport step(FitModel& model, uint64_t iteration, uint64_t iterations,
                  ViewEvaluator* views = nullptr) {
    moment_.iteration = iteration;
    moment_.iterations = iterations;
    view_.index = iteration % kEventViews;
    return model.step(moment_, view_, views, nullptr);
  }
  const Camera& camera() const { return camera_; }
  const std::vector<float>& target() const { return target_; }

 private:
  Camera camera_;
  std::vector<float> target_;
  StepView view_;
  FitMoment moment_;
};

/// The same view several times over, for strategies that look around.
class SameViews {
 public:
  SameViews(FitModel& model, const OneView& view) {
    auto source = std::make_shared<MemoryViewSource>(ColourSpace::kDisplay);
    for (size_t v = 0; v < kEventViews; ++v) {
      ViewPicture picture;
      picture.width = view.camera().width;
      picture.height = view.camera().height;
      picture.colour.assign(view.target().begin(), view.target().end());
      source->add(view.camera(), std::move(picture));
      training_.push_back(v);
    }
    pictures_ = std::make_unique<PictureStore>(source, uint64_t{1} << 28);
    evaluator_ = std::make_unique<FitViewEvaluator>(
        *cpuBackends(), [&model] { return model.splats(0); }, *pictures_, training_, kBlack, 0.2);
  }
  FitViewEvaluator& evaluator() { return *evaluator_; }

 private:
  static constexpr double kBlack[3] = {0, 0, 0};
  std::vector<size_t> training_;
  std::unique_ptr<PictureStore> pictures_;
  std::unique_ptr<FitViewEvaluator> evaluator_;
};

/// In the window of density control, so that statistics are gathered, and between its edits.
void steps(benchmark::State& state, const SplatCase& c) {
  OneView view(c);
  ExplicitModelOptions options;
  options.sh_degree = c.degree;
  const auto model =
      makeExplicitModel(*cpuBackends(), cloudOf(c), makeStrategy("adaptive"), options);
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
        state, "passes", [&] { view.step(*model, ++iteration, 1000000); },
        [&] {
          backend->forward(view.camera(), render);
          backend->loss(view.target(), {});
          backend->backward({});
          backend->step(step);
        });
  });
}

/// Iterations that leave splats out, of which some are drawn more opaque, against whole ones.
void dropoutSteps(benchmark::State& state, const SplatCase& c) {
  OneView view(c);
  ExplicitModelOptions options;
  options.sh_degree = c.degree;
  const auto modelOf = [&](const char* strategy) {
    return makeExplicitModel(*cpuBackends(), cloudOf(c), makeStrategy(strategy), options);
  };
  const auto thinned = modelOf("adaptive+splat_dropout");
  const auto whole = modelOf("adaptive");
  uint64_t iteration = 600000;  // after the last event
  withThreads(2, [&] {
    compare(
        state, "all_splats", [&] { view.step(*thinned, ++iteration, 1000000); },
        [&] { view.step(*whole, iteration + 1, 1000000); });
  });
}

/// A strategy that makes a twentieth more splats of those of the case at iteration 600, wherever it
/// has a threshold: of whatever is pulled at.
struct EventSettings {
  const char* name;
  const char* strategy;
  bool caps = true;         ///< by the hard cap
  uint64_t event = 600;     ///< the iteration that is timed
  uint64_t interval = 100;  ///< iterations between two
};
constexpr EventSettings kEventSettings[] = {
    {"adaptive", "adaptive(threshold=1e-9)"},
    {"absolute", "absolute(threshold=1e-9,copy_threshold=1e-9)"},
    // 3,727,100 sqrt(100 / 14,000) = 315,000, its count at 600.
    {"improved", "improved(threshold=1e-9,splats=3727100)", false},
    {"direction", "direction(threshold=1e-9)"},
    {"volumetric", "volumetric(threshold=1e-9)"},
    // Its second event, which removes too.
    {"frequency", "frequency(threshold=1e-9)", true, 1500, 500},
};

EventSettings settingsOf(const std::string& name) {
  for (const EventSettings& each : kEventSettings) {
    if (name == each.name) return each;
  }
  return {name.c_str(), name.c_str()};
}

/// Iterations before an event in which strategies may gather what others do not.
constexpr uint64_t kLastIterations = 2 * kEventViews - 1;

/// What an event costs beyond the iterations that it follows, from its statistics to the edited
/// parameters, against those until the next one: the last ones and the edit, less as many that
/// gather nothing more.
void densifyEvent(benchmark::State& state, const std::string& name) {
  const SplatCase& c = kEventCase;
  const EventSettings settings = settingsOf(name);
  OneView view(c);
  ExplicitModelOptions options;
  options.sh_degree = c.degree;
  if (settings.caps) options.max_splats = c.splats + c.splats / 20;
  const auto model =
      makeExplicitModel(*cpuBackends(), cloudOf(c), makeStrategy(settings.strategy), options);
  SameViews views(*model, view);
  double best_step = 1e300, best_last = 1e300, best_edit = 1e300;
  size_t count = 0;
  withThreads(2, [&] {
    view.step(*model, settings.event - 60, 30000, &views.evaluator());
    const TensorTable saved = model->state();
    for (auto round : state) {
      (void)round;
      model->restore(saved);
      uint64_t iteration = settings.event - 60;
      const auto step = [&] {
        views.evaluator().forgetSplats();
        return view.step(*model, ++iteration, 30000, &views.evaluator());
      };
      step();
      for (int k = 0; k < 4; ++k) best_step = std::min(best_step, secondsOf(step));
      iteration = settings.event - kLastIterations;
      double last = 0, edit = 0;
      while (iteration < settings.event) {
        last += secondsOf([&] { edit = step().seconds.edit; });
      }
      state.SetIterationTime(last);
      best_last = std::min(best_last, last);
      best_edit = std::min(best_edit, edit);
      count = model->budgets()[0];
    }
  });
  const double event = std::max(1e-6, best_last - static_cast<double>(kLastIterations) * best_step);
  state.counters["best_ms"] = 1e3 * event;
  state.counters["edit_ms"] = 1e3 * best_edit;
  state.counters["splats_after"] = static_cast<double>(count);
  const double between = static_cast<double>(settings.interval) * best_step;
  const std::string against = std::to_string(settings.interval) + "_iterations";
  state.counters["reference_ms"] = 1e3 * between;
  state.counters["ratio_" + against] = between / event;
}

const bool registered = [] {
  for (const SplatCase& c : kStepCases) {
    benchmark::RegisterBenchmark((std::string("train.step.explicit.") + c.name).c_str(), steps, c)
        ->UseManualTime()
        ->Iterations(kRounds)
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((std::string("train.step.dropout.") + c.name).c_str(),
                                 dropoutSteps, c)
        ->UseManualTime()
        ->Iterations(kRounds)
        ->Unit(benchmark::kMillisecond);
  }
  for (const std::string& name : strategyNames()) {
    benchmark::RegisterBenchmark(("train.densify_event." + name + ".300k").c_str(), densifyEvent,
                                 name)
        ->UseManualTime()
        ->Iterations(3)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
