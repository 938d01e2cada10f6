// A step of a fit of splats that move, against one of as many splats that stand still: both draw
// the same splats, as nothing has moved yet; the difference is the making of splats at a time, its
// derivatives, and Adam over 31 more numbers of each.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench/comparison.h"
#include "bench/splat_scene.h"
#include "densify/raw_splats.h"
#include "train/backend/render_backend.h"
#include "train/loop/moving_splats.h"

namespace stipple::bench {
namespace {

// As many as a fit of a small clip has, and a scene of middle size.
constexpr SplatCase kCases[] = {
    {"60k_320x180", 60000, 320, 180, 3, 1.0},
    {"150k_800x800", 150000, 800, 800, 3, 1.0},
};
constexpr int kSteps = 10;
constexpr uint32_t kFrames = 300;

/// A fit of the scene to its own picture, a little darker.
class StepOfFit {
 public:
  StepOfFit(const SplatCase& c, bool moves) : case_(c), backend_(makeCpuBackend()) {
    options_.with_depth = false;
    backend_->upload(cloudOf(c));
    if (moves) beginMotion();
    backend_->forward(cameraOf(c), options_);
    const std::vector<float> picture = backend_->picture();
    std::vector<float> target;
    for (size_t i = 0; i < picture.size(); ++i) {
      if (i % 4 < 3) target.push_back(0.9f * picture[i]);
    }
    backend_->addTarget(c.width, c.height, target);
    // So small that the scene stays what it is.
    step_.learning_rates.fill(1e-9);
  }

  void take() {
    if (motion_) {
      frame_ = (frame_ + 97) % kFrames;
      motion_->setTime(frame_ / motion_->clip().frames_per_second);
      backend_->parameterise(motion_.get());
    }
    backend_->forward(cameraOf(case_), options_);
    backend_->loss(0, {});
    backend_->backward({});
    backend_->step(step_);
  }

 private:
  void beginMotion() {
    MotionClip clip;
    clip.frame_count = kFrames;
    motion_ = std::make_unique<MovingParameterisation>(clip, nullptr, 0);
    TrainingState state = backend_->state();
    state.splats.extra_lengths = MovingParameterisation::extraLengths();
    state.splats.extras = motion_->initialExtras(state.splats.size(), {}, 0);
    // They live far longer than the clip: as opaque at all times as those that stand still.
    auto& lifespans = state.splats.extras[state.splats.extras.size() - 2];
    std::fill(lifespans.begin(), lifespans.end(), 20.0f);
    state.first_moments = state.second_moments = zerosLike(state.splats);
    backend_->restore(state);
    step_.extra_rates.assign(state.splats.extra_lengths.size(), 1e-9);
    backend_->parameterise(motion_.get());
  }

  SplatCase case_;
  std::unique_ptr<RenderBackend> backend_;
  std::unique_ptr<MovingParameterisation> motion_;
  RenderOptions options_;
  StepOptions step_;
  uint32_t frame_ = 0;
};

void motionStep(benchmark::State& state, const SplatCase& c) {
  StepOfFit moving(c, true), still(c, false);
  moving.take();
  still.take();
  compare(
      state, "still", [&] { moving.take(); }, [&] { still.take(); });
}

const bool registered = [] {
  for (const SplatCase& c : kCases) {
    benchmark::RegisterBenchmark((std::string("motion.step.") + c.name).c_str(), motionStep, c)
        ->UseManualTime()
        ->Iterations(kSteps)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

}  // namespace
}  // namespace stipple::bench
