// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, sections 5 and 7.1 (rates, loss, harmonics one degree at a time).

#include "train/loop/explicit_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/stopwatch.h"
#include "data/clouds/sh_degree.h"
#include "densify/strategies.h"
#include "train/loop/backend_control.h"
#include "train/loop/moving_splats.h"
#include "train/loop/splat_tables.h"
#include "train/prior/start_splats.h"

namespace stipple {

namespace {

/// Iterations, of 30,000, after which harmonics get another degree.
constexpr uint64_t kDegreeInterval = 1000;

uint64_t smallerLimit(uint64_t a, uint64_t b) {
  return a == 0 || b == 0 ? std::max(a, b) : std::min(a, b);
}

void requireOptions(const ExplicitModelOptions& options) {
  if (options.sh_degree < 0 || options.sh_degree > kMaxShDegree) {
    fail(ErrorCode::kInvalidArgument,
         "sh_degree is " + std::to_string(options.sh_degree) + "; 0 to 4 is allowed");
  }
  if (!(options.ssim_share >= 0 && options.ssim_share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "ssim_share is " + std::to_string(options.ssim_share) + "; 0 to 1 is allowed");
  }
}

class ExplicitModel final : public FitModel, private Regulariser {
 public:
  ExplicitModel(const BackendFactory& backends, const SplatCloud& start,
                const StartMoments& moments, std::unique_ptr<Strategy> strategy,
                const ExplicitModelOptions& options, bool begins, int least_degree = 0)
      : strategy_(std::move(strategy)),
        options_(options),
        backend_(backends.makeRenderBackend()),
        least_degree_(least_degree) {
    backend_->upload(start);
    if (begins) prepare();
    step_options_.extra_rates = beginControl(*backend_, *strategy_);
    strategy_->adjustRates(rates_);
    if (options.clip) beginMotion(*options.clip, moments);
  }

  const char* name() const override { return motion_ ? "motion" : "explicit"; }

  StepReport step(const FitMoment& given, const StepView& view, ViewEvaluator* views,
                  Progress* progress) override {
    moment_ = given;
    moment_.max_splats = smallerLimit(given.max_splats, options_.max_splats);
    moment_.position_rate = positionRate();
    const size_t pixel_count = size_t{view.camera->width} * view.camera->height;
    view_under_way_ = {
        view.index, view.camera->width, view.camera->height, {view.target, pixel_count * 3}};
    moment_.view = &view_under_way_;
    StepReport report;
    report.stage = "Splats";
    report.splat_count = backend_->splatCount();
    transmittance_weight_ = view.is_opaque ? strategy_->transmittanceWeight(moment_) : 0.0;
    Stopwatch watch;
    showTime(view.time);
    backend_->weighOpacities(strategy_->opacityFactors(moment_, backend_->splatCount()));
    backend_->forward(*view.camera, renderOptions(view), progress);
    report.seconds.render = watch.lap();

    const StatisticRequest request = strategy_->requests(moment_);
    const ImageLossValue value =
        backend_->loss({view.target, pixel_count * 3}, lossFor(request, options_.ssim_share),
                       {view.weights, view.weights ? pixel_count : size_t{0}});
    const BackwardSummary summary = backend_->backward(request, this, progress);
    report.loss = value.loss + summary.regularisation;
    report.l1 = value.l1;
    report.ssim = value.ssim;
    report.seconds.backward = watch.lap();

    if (request.any()) {
      lifespans_.clear();
      if (request.lifespans && motion_) motion_->lifespansInUse(backend_->splats(), lifespans_);
      observeView(*backend_, *strategy_, moment_, view.index, lifespans_);
    }
    report.seconds.edit = watch.lap();
    if (strategy_->stepGate(moment_)) {
      setRates();
      backend_->step(step_options_);
    } else {
      backend_->keepGradients();
    }
    report.seconds.optimiser = watch.lap();

    const auto apply = [this](const std::optional<SplatEdit>& edit) {
      applyControl(*backend_, *strategy_, moment_, edit);
    };
    apply(strategy_->afterStep(moment_, storeOf(*backend_)));
    if (views && strategy_->wantsSweep(moment_)) {
      strategy_->sweep(moment_, *views);
      if (how()) backend_->parameterise(how());
    }
    apply(strategy_->edit(moment_, storeOf(*backend_)));
    report.seconds.edit += watch.lap();
    return report;
  }

  SplatCloud splats(uint64_t budget) override {
    return splatsAt(budget, motion_ ? motion_->clip().begin : 0);
  }
  bool moves() const override { return motion_ != nullptr; }
  SplatCloud splatsAt(uint64_t, double seconds) override {
    showTime(seconds);
    return backend_->download();
  }
  std::optional<MotionCloud> moving() const {
    if (!motion_) return std::nullopt;
    return motion_->cloudOf(backend_->state().splats);
  }
  std::vector<uint64_t> budgets() const override { return {backend_->splatCount()}; }
  bool lowersOpacitiesAt(const FitMoment& moment) const override {
    return strategy_->lowersOpacitiesAt(moment);
  }
  uint64_t foggyStepsAfter(const FitMoment& moment) const override {
    return strategy_->foggyStepsAfter(moment);
  }
  SplatQuantities seen() const override { return strategy_->seen(backend_->splatCount()); }

  TensorTable state() const override {
    TensorTable table;
    putTrainingState(backend_->state(), table);
    putText(strategy_->name(), "strategy.name", table);
    for (auto& [name, tensor] : strategy_->state()) {
      table["strategy.state." + name] = std::move(tensor);
    }
    return table;
  }

  void restore(const TensorTable& table) override {
    const std::string name = takeText(table, "strategy.name");
    if (name != strategy_->name()) {
      fail(ErrorCode::kFormat, "the checkpoint is of strategy '" + name + "'; this fit has '" +
                                   strategy_->name() + "'");
    }
    const TrainingState before = backend_->state();
    backend_->restore(takeTrainingState(table, before.splats));
    try {
      strategy_->restore(takePart(table, "strategy.state."));
    } catch (...) {
      backend_->restore(before);
      throw;
    }
  }

  uint64_t memoryBytes() const override { return backend_->memoryBytes(); }

 private:
  void prepare() {
    TrainingState state = backend_->state();
    strategy_->prepare(state.splats, options_.iterations);
    backend_->restore(state);
  }

  /// Gives the splats the numbers of their motion, behind what the strategy trains beside them.
  void beginMotion(MotionClip clip, const StartMoments& moments) {
    TimeStretch stretch;
    strategy_->adjustStretch(stretch);
    clip.window_frames = stretch.frames;
    clip.window_share = stretch.share;
    TrainingState state = backend_->state();
    motion_extra_ = state.splats.extra_lengths.size();
    motion_ = std::make_unique<MovingParameterisation>(clip, strategy_->parameterisation(),
                                                       motion_extra_);
    for (const size_t length : MovingParameterisation::extraLengths()) {
      state.splats.extra_lengths.push_back(length);
    }
    for (auto& values : motion_->initialExtras(state.splats.size(), moments, options_.seed)) {
      state.splats.extras.push_back(std::move(values));
    }
    state.first_moments = state.second_moments = zerosLike(state.splats);
    backend_->restore(state);
    backend_->parameterise(motion_.get());
  }

  /// From raw numbers to splats, where that is not the usual way; else null.
  const Parameterisation* how() const {
    return motion_ ? motion_.get() : strategy_->parameterisation();
  }

  /// What is drawn from now on is as it is at this time. A time is to the backend what a changed
  /// formula from raw numbers to splats is.
  void showTime(double seconds) {
    if (!motion_) return;
    motion_->setTime(seconds);
    backend_->parameterise(motion_.get());
  }

  RenderOptions renderOptions(const StepView& view) const {
    RenderOptions options;
    options.with_depth = false;
    options.with_background = true;
    options.with_transmittance = transmittance_weight_ != 0;
    std::copy_n(view.background, 3, options.background);
    const uint64_t degree = moment_.iteration / scaleSchedule(kDegreeInterval, moment_.iterations);
    options.sh_degree_limit =
        std::max(least_degree_,
                 static_cast<int>(std::min<uint64_t>(degree, static_cast<uint64_t>(kMaxShDegree))));
    return options;
  }

  double positionRate() const {
    const double progress =
        std::min(1.0, static_cast<double>(moment_.iteration) /
                          static_cast<double>(std::max<uint64_t>(1, moment_.iterations)));
    return rates_.first_position *
           std::pow(rates_.last_position / rates_.first_position, progress) *
           std::max(moment_.extent, 0.0);
  }

  void setRates() {
    const auto set = [&](ParameterGroup group, double rate) {
      step_options_.learning_rates[static_cast<size_t>(group)] = std::min(rate, kMaxLearningRate);
    };
    set(ParameterGroup::kPositions, moment_.position_rate);
    set(ParameterGroup::kRotations, rates_.rotation);
    set(ParameterGroup::kLogScales, rates_.log_scale);
    set(ParameterGroup::kLogits, rates_.logit);
    set(ParameterGroup::kShFirst, rates_.colour);
    set(ParameterGroup::kShOthers, rates_.higher_colour);
    if (!motion_) return;
    step_options_.extra_rates.resize(motion_extra_);
    for (const double rate :
         MovingParameterisation::rates(moment_.position_rate, std::max(moment_.extent, 0.0))) {
      step_options_.extra_rates.push_back(std::min(rate, kMaxLearningRate));
    }
  }

  /// The strategy's part of the loss, called by the backend.
  double evaluate(const SplatCloud& cloud, const CloudGradient& gradient) override {
    return strategy_->loss(moment_, cloud, gradient);
  }

  bool readsSplats() const override { return strategy_->regularises(moment_); }
  double transmittanceWeight() const override { return transmittance_weight_; }

  std::unique_ptr<Strategy> strategy_;  ///< outlives the backend, which draws by its activations
  std::unique_ptr<MovingParameterisation> motion_;  ///< the same; null: splats stand still
  size_t motion_extra_ = 0;                         ///< the first of its extras
  std::vector<float> lifespans_;                    ///< [N] of the step under way, where asked for
  ExplicitModelOptions options_;
  std::unique_ptr<RenderBackend> backend_;
  LearningRates rates_;
  StepOptions step_options_;
  FitMoment moment_;  ///< of the step under way
  TrainingView view_under_way_;
  double transmittance_weight_ = 0;  ///< of the step under way
  int least_degree_;                 ///< of harmonics that are drawn from the first step on
};

}  // namespace

uint64_t bytesPerSplat(int sh_degree, bool moves) {
  uint64_t others = 11;  // place, turn, size, opacity
  for (const size_t length : MovingParameterisation::extraLengths()) others += moves ? length : 0;
  constexpr uint64_t kOfDrawing = 250;  // with statistics
  const uint64_t row = (others + shCoefficientCount(sh_degree) * 3) * sizeof(float);
  return row * 13 + kOfDrawing;
}

std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const ViewSource& views,
                                            std::span<const size_t> training,
                                            const ExplicitModelOptions& options,
                                            Progress* progress) {
  requireOptions(options);
  if (training.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no views to learn from; at least one is needed");
  }
  std::unique_ptr<Strategy> strategy = makeStrategy(options.strategy);
  StartOptions start;
  start.count = options.start_splats;
  start.max_count = options.max_splats;
  start.sh_degree = options.sh_degree;
  start.antialias = options.antialias;
  start.seed = options.seed;
  start.with_lives = options.clip.has_value();
  const StartSplats begin = startSplats(views, training, start, progress);
  return std::make_unique<ExplicitModel>(backends, begin.splats,
                                         StartMoments{begin.times, begin.lives},
                                         std::move(strategy), options, true);
}

std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const SplatCloud& start,
                                            const ExplicitModelOptions& options) {
  requireOptions(options);
  if (start.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "there are no splats to begin with; at least one is needed");
  }
  SplatCloud begin = withShDegree(start, options.sh_degree);
  begin.antialias = options.antialias;
  return std::make_unique<ExplicitModel>(backends, begin, StartMoments(),
                                         makeStrategy(options.strategy), options, false,
                                         std::min(start.sh_degree, options.sh_degree));
}

std::unique_ptr<FitModel> makeExplicitModel(const BackendFactory& backends, const SplatCloud& start,
                                            std::unique_ptr<Strategy> strategy,
                                            const ExplicitModelOptions& options) {
  requireOptions(options);
  return std::make_unique<ExplicitModel>(backends, start, StartMoments(), std::move(strategy),
                                         options, false);
}

std::optional<MotionCloud> motionResult(const FitModel& model) {
  const auto* explicit_model = dynamic_cast<const ExplicitModel*>(&model);
  return explicit_model ? explicit_model->moving() : std::nullopt;
}

}  // namespace stipple
