#include "train/loop/trainer.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/random.h"
#include "base/stopwatch.h"
#include "train/loop/contributions.h"
#include "train/loop/fit_state.h"

namespace stipple {

namespace {

/// Views of a measurement while a fit runs, and of the one at its end: enough for a mean that means
/// something, few enough to take no time beside the steps.
constexpr size_t kMeasuredViews = 8;
constexpr size_t kFinallyMeasuredViews = 200;
/// Views that are learned from, by which the best state is chosen: as many as a measurement has.
/// States that are measured one after the other differ by tenths of a dB where one is spoilt, and
/// the views are the same each time, so that what tells views apart cancels.
constexpr size_t kChoosingViews = 8;
// Of previews, that contributions are measured over.
constexpr size_t kPreviewedViews = 8;
constexpr uint64_t kMeasuresPerFit = 20;
constexpr uint64_t kLeastMeasureInterval = 100;
/// Iterations whose loss and time are averaged for the figures.
constexpr size_t kRecentIterations = 50;
/// Shares of a fit that look at images of a quarter and of half the width, where those have as many
/// pixels as kLeastPixels.
constexpr double kQuarterUntil = 0.4;
constexpr double kHalfUntil = 0.9;
constexpr uint64_t kLeastPixels = 30000;
/// Of the time of a step, the share that does not depend on pixels.
constexpr double kCostBesidePixels = 0.3;
constexpr uint64_t kEstimateSteps = 20;
/// The first of those steps allocate and load; the estimate leaves them out.
constexpr uint64_t kWarmUpSteps = 5;

/// At most `count` of them, evenly.
std::vector<size_t> someOf(const std::vector<size_t>& views, size_t count) {
  const size_t chosen = std::min(views.size(), count);
  std::vector<size_t> some(chosen);
  for (size_t i = 0; i < chosen; ++i) some[i] = views[i * views.size() / chosen];
  return some;
}

const std::vector<size_t>& viewsToMeasure(const FitViews& split) {
  return split.held_out.empty() ? split.training : split.held_out;
}

FitRecord recordOf(const StepReport& report, double seconds) {
  const StepSeconds& part = report.seconds;
  const double named = part.render + part.backward + part.field + part.optimiser + part.edit;
  FitRecord record;
  record.loss = static_cast<float>(report.loss);
  record.l1 = static_cast<float>(report.l1);
  record.ssim = static_cast<float>(report.ssim);
  record.splat_count = static_cast<uint32_t>(report.splat_count);
  record.render_seconds = static_cast<float>(part.render);
  record.backward_seconds = static_cast<float>(part.backward);
  record.field_seconds = static_cast<float>(part.field);
  record.optimiser_seconds = static_cast<float>(part.optimiser);
  record.edit_seconds = static_cast<float>(part.edit);
  record.other_seconds = static_cast<float>(std::max(0.0, seconds - named));
  return record;
}

void requireOptions(const TrainerOptions& options) {
  if (options.iterations < 1 || options.iterations > kMaxFitIterations) {
    fail(ErrorCode::kInvalidArgument, "iterations is " + std::to_string(options.iterations) +
                                          "; 1 to " + std::to_string(kMaxFitIterations) +
                                          " is allowed");
  }
  if (!(options.checkpoint_seconds >= 0) || !std::isfinite(options.checkpoint_seconds)) {
    fail(ErrorCode::kInvalidArgument, "checkpoint_seconds is " +
                                          std::to_string(options.checkpoint_seconds) +
                                          "; 0 or more is allowed");
  }
}

}  // namespace

/// Clocks of one run; nothing of it reaches a result.
struct Trainer::Pace {
  Stopwatch begun;
  Stopwatch saved;  ///< since the last checkpoint
  uint64_t first_iteration = 0;
  std::vector<double> step_seconds;  ///< of this run
  std::optional<double> estimated_seconds;
  std::optional<uint64_t> estimated_bytes;

  double recent() const {
    const size_t count = std::min(step_seconds.size(), kRecentIterations);
    if (count == 0) return 0;
    return std::accumulate(step_seconds.end() - static_cast<ptrdiff_t>(count), step_seconds.end(),
                           0.0) /
           static_cast<double>(count);
  }
};

Trainer::Trainer(const BackendFactory& backends, std::shared_ptr<const ViewSource> views,
                 FitViews split, std::unique_ptr<FitModel> model, const TrainerOptions& options)
    : options_(options),
      pictures_(std::move(views), options.picture_bytes),
      split_(std::move(split)),
      measured_(someOf(viewsToMeasure(split_), kMeasuredViews)),
      choosing_(someOf(split_.training, kChoosingViews)),
      model_(std::move(model)),
      extent_(1.0),
      order_(split_.training.size(), options.seed),
      measure_(backends) {
  requireOptions(options);
  if (split_.training.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no views to learn from; at least one is needed");
  }
  extent_ = extentOfCameras(pictures_.views(), split_.training);
  centre_ = centreOfCameras(pictures_.views(), split_.training);
  measure_.tellMoving(pictures_.views());
  double background[3];
  backgroundOf(0, background);
  evaluator_ = std::make_unique<FitViewEvaluator>(backends, splatsOf(0), pictures_, split_.training,
                                                  background, options.ssim_share);
  history_.measured_on_held_out = !split_.held_out.empty();
  history_.training_view_count = split_.training.size();
}

Trainer::~Trainer() = default;

uint64_t Trainer::measureInterval() const {
  if (options_.measure_interval > 0) return options_.measure_interval;
  const uint64_t interval = std::max(kLeastMeasureInterval, options_.iterations / kMeasuresPerFit);
  // Whole images are measured, which takes long beside steps that look at fewer pixels.
  return reduction_ > 1 ? 2 * interval : interval;
}

FitMoment Trainer::momentOf(uint64_t iteration) const {
  FitMoment moment;
  moment.iteration = iteration;
  moment.iterations = options_.iterations;
  moment.extent = extent_;
  moment.centre = centre_;
  moment.seed = options_.seed;
  moment.max_splats = options_.max_splats;
  moment.view_count = split_.training.size();
  return moment;
}

/// Where the step before lowered opacities, splats look like fog: they are measured before it.
bool Trainer::measureIsDue() const {
  if (iteration_ == options_.iterations) return true;
  const uint64_t interval = measureInterval();
  const auto lowers = [this](uint64_t at) { return model_->lowersOpacitiesAt(momentOf(at)); };
  if (iteration_ % interval == 0) return !lowers(iteration_);
  return (iteration_ + 1) % interval == 0 && lowers(iteration_ + 1);
}

void Trainer::backgroundOf(uint64_t iteration, double background[3]) const {
  for (uint64_t c = 0; c < 3; ++c) {
    background[c] = options_.background == BackgroundPolicy::kWhite ? 1.0 : 0.0;
    if (options_.background != BackgroundPolicy::kRandom || iteration == 0) continue;
    background[c] = unitDouble(keyedBits(options_.seed, RandomUse::kBackground, iteration * 3 + c));
  }
}

/// Pixels along a block that one pixel of this iteration stands for.
uint32_t Trainer::reductionAt(uint64_t iteration, uint64_t pixel_count) const {
  if (!options_.coarse_to_fine) return 1;
  const double done = static_cast<double>(iteration) / static_cast<double>(options_.iterations);
  uint32_t factor = done <= kQuarterUntil ? 4 : done <= kHalfUntil ? 2 : 1;
  while (factor > 1 && pixel_count < kLeastPixels * factor * factor) factor /= 2;
  return factor;
}

/// Steps that are left, counted in such as the present one: those of whole images take longer.
double Trainer::stepsLeft(uint64_t iteration) const {
  const auto pixels = uint64_t{target_.width} * target_.height * reduction_ * reduction_;
  const auto costAt = [&](uint64_t at) {
    const double factor = reductionAt(at, pixels);
    return kCostBesidePixels + (1 - kCostBesidePixels) / (factor * factor);
  };
  double left = 0;
  for (uint64_t at = iteration + 1; at <= options_.iterations;) {
    // As far as the next change.
    uint64_t last = options_.iterations;
    for (const double share : {kQuarterUntil, kHalfUntil}) {
      const auto change = static_cast<uint64_t>(share * static_cast<double>(options_.iterations));
      if (change >= at) last = std::min(last, change);
    }
    left += static_cast<double>(last - at + 1) * costAt(at);
    at = last + 1;
  }
  return iteration > 0 ? left / costAt(iteration) : left;
}

/// In: iterations that are done before it.
size_t Trainer::viewOf(uint64_t iteration) {
  return model_->viewAt(iteration).value_or(order_.at(iteration));
}

void Trainer::step(Pace& pace) {
  const Stopwatch watch;
  FitMoment moment = momentOf(iteration_ + 1);
  StepView view;
  view.index = viewOf(iteration_);
  const size_t source_view = split_.training[view.index];
  view.camera = &pictures_.views().camera(source_view);
  view.time = moment.time = pictures_.views().time(source_view);
  backgroundOf(moment.iteration, view.background);
  pictures_.load(source_view, view.background, target_);
  if (target_.alpha.empty()) backgroundOf(0, view.background);
  if (moment.iteration < options_.iterations) {
    pictures_.prefetch(split_.training[viewOf(moment.iteration)]);
  }
  Camera camera = *view.camera;
  reduction_ = reductionAt(moment.iteration, uint64_t{target_.width} * target_.height);
  if (reduction_ > 1) {
    reducePicture(reduction_, target_, camera);
    view.camera = &camera;
  }
  view.target = target_.colour.data();
  view.weights = target_.weights.empty() ? nullptr : target_.weights.data();
  view.is_opaque = target_.alpha.empty();
  evaluator_->forgetSplats();
  // A step is never left half-way: what was cancelled must go on bit for bit.
  const StepReport report = model_->step(moment, view, evaluator_.get(), nullptr);
  stage_ = report.stage;
  ++iteration_;
  const double seconds = watch.seconds();
  history_.records.push_back(recordOf(report, seconds));
  pace.step_seconds.push_back(seconds);
}

void Trainer::measure() {
  FitMeasure measure = measureOf(0, measured_);
  measure.iteration = iteration_;
  // Views that are held out judge the result; who chose it by them would flatter it.
  double best = -std::numeric_limits<double>::infinity();
  for (const FitMeasure& earlier : history_.measures) best = std::max(best, earlier.training_psnr);
  history_.measures.push_back(measure);
  if (measure.training_psnr < best && !model_->isWholeAtItsEndOnly()) return;
  history_.best_iteration = iteration_;
  best_.reset();
}

SplatsOverTime Trainer::splatsOf(uint64_t budget) {
  return {[this, budget](double seconds) { return model_->splatsAt(budget, seconds); },
          model_->moves()};
}

/// In: views: that the figures are of; the choice of the best looks at others.
FitMeasure Trainer::measureOf(uint64_t budget, std::span<const size_t> views) {
  SplatsOverTime splats = splatsOf(budget);
  double background[3];
  backgroundOf(0, background);
  FitMeasure measure = measure_.measure(splats, pictures_, views, background);
  measure.training_psnr = measure_.meanPsnr(splats, pictures_, choosing_, background);
  measure.density_entropy =
      model_->densityEntropy().value_or(std::numeric_limits<double>::quiet_NaN());
  return measure;
}

void Trainer::keepBest() {
  if (!best_) return;
  model_->restore(*best_);
  best_.reset();
}

void Trainer::measureBudgets() {
  const std::vector<size_t> views = someOf(viewsToMeasure(split_), kFinallyMeasuredViews);
  history_.measured_view_count = views.size();
  history_.by_budget.clear();
  for (const uint64_t budget : model_->budgets()) {
    FitMeasure measure = measureOf(budget, views);
    measure.iteration = history_.best_iteration;
    measure.budget = budget;
    history_.by_budget.push_back(measure);
  }
}

/// In: most_views, of those that contributions are measured over; 0: they are not.
SplatQuantities Trainer::look(size_t most_views) {
  SplatQuantities quantities = model_->seen();
  if (most_views > 0) {
    evaluator_->forgetSplats();
    quantities.contribution = meanContributions(*evaluator_, most_views);
  }
  return quantities;
}

void Trainer::save(FitObserver& observer, Pace& pace) {
  try {
    observer.save(state());
  } catch (const Error& error) {
    observer.note(std::string("the checkpoint is not saved: ") + error.what());
  }
  pace.saved = Stopwatch();
}

void Trainer::report(FitObserver& observer, const Pace& pace) const {
  FitFigures figures;
  figures.iteration = iteration_;
  figures.iterations = options_.iterations;
  figures.stage = stage_;
  if (!history_.records.empty()) {
    const size_t count = std::min(history_.records.size(), kRecentIterations);
    for (size_t i = history_.records.size() - count; i < history_.records.size(); ++i) {
      figures.loss += static_cast<double>(history_.records[i].loss) / static_cast<double>(count);
    }
    figures.splat_count = history_.records.back().splat_count;
  }
  // Steps may draw fewer than there are; what is done is counted at its largest budget.
  if (!history_.by_budget.empty()) figures.splat_count = history_.by_budget.back().splat_count;
  for (const FitMeasure& measure : history_.measures) {
    figures.psnr = measure.psnr;
    if (measure.iteration != history_.best_iteration) continue;
    figures.best_psnr = measure.psnr;
    if (std::isfinite(measure.moving_psnr)) figures.best_moving_psnr = measure.moving_psnr;
  }
  figures.best_iteration = history_.best_iteration;
  figures.seconds = pace.begun.seconds();
  figures.seconds_left = pace.recent() * stepsLeft(iteration_);
  figures.estimated_seconds = pace.estimated_seconds;
  figures.estimated_bytes = pace.estimated_bytes;
  observer.figures(figures);
}

FitEnd Trainer::run(FitObserver& observer, Progress* progress) {
  Pace pace;
  pace.first_iteration = iteration_;
  std::exception_ptr error;
  FitEnd end = FitEnd::kWhole;
  while (iteration_ < options_.iterations) {
    if (progress && progress->cancelled()) {
      end = FitEnd::kStopped;
      break;
    }
    // The best is kept before it is trained any further.
    const bool is_best = history_.best_iteration == iteration_ && iteration_ > 0;
    if (!best_ && is_best && !model_->isWholeAtItsEndOnly()) best_ = model_->state();
    try {
      step(pace);
      const uint64_t foggy = model_->foggyStepsAfter(momentOf(iteration_));
      foggy_until_ = std::max(foggy_until_, iteration_ + foggy);
    } catch (...) {
      error = std::current_exception();
      break;
    }
    if (measureIsDue()) measure();
    const uint64_t taken = iteration_ - pace.first_iteration;
    if (taken == kEstimateSteps) {
      const double mean =
          std::accumulate(pace.step_seconds.begin() + kWarmUpSteps, pace.step_seconds.end(), 0.0) /
          static_cast<double>(kEstimateSteps - kWarmUpSteps);
      pace.estimated_seconds = pace.begun.seconds() + mean * stepsLeft(iteration_);
      pace.estimated_bytes = memoryBytes();
    }
    const bool interval_is_over =
        options_.checkpoint_interval > 0 && iteration_ % options_.checkpoint_interval == 0;
    const bool time_is_over =
        options_.checkpoint_seconds > 0 && pace.saved.seconds() >= options_.checkpoint_seconds;
    if (interval_is_over || time_is_over) save(observer, pace);
    // The last clear image stands while opacities come back.
    if (observer.wantsPreview() && iteration_ >= foggy_until_) {
      const size_t views = observer.wantsContributions() ? kPreviewedViews : 0;
      const std::optional<double> time = observer.previewTime();
      SplatCloud shown = time ? model_->splatsAt(0, *time) : model_->splats(0);
      observer.preview(std::move(shown), look(views));
    }
    report(observer, pace);
    if (progress && !progress->cancelled()) {
      progress->advance(static_cast<double>(iteration_) / static_cast<double>(options_.iterations),
                        stage_);
    }
  }
  const bool saves = options_.checkpoint_interval > 0 || options_.checkpoint_seconds > 0;
  if (!error && saves) save(observer, pace);
  try {
    // What was trained since the last measurement may be the best; after a failed step, or with
    // views that cannot be read, nobody knows.
    if (!error && iteration_ > 0 &&
        (history_.measures.empty() || history_.measures.back().iteration != iteration_)) {
      measure();
    }
    keepBest();
    if (!error && iteration_ > 0) {
      model_->finish(*evaluator_);
      measureBudgets();
      seen_ = look(kContributionViews);
    }
  } catch (...) {
    if (!error) error = std::current_exception();
    keepBest();
  }
  report(observer, pace);
  if (error) std::rethrow_exception(error);
  return end;
}

TensorTable Trainer::state() const {
  TensorTable table = model_->state();
  addFitState(table, iteration_, history_);
  if (best_) addBest(table, *best_);
  return table;
}

void Trainer::restore(const TensorTable& state) {
  FitHistory history = history_;
  const uint64_t iteration = takeFitState(state, history);
  if (iteration > options_.iterations) {
    fail(ErrorCode::kFormat, "the checkpoint is of iteration " + std::to_string(iteration) +
                                 "; the fit has " + std::to_string(options_.iterations));
  }
  std::optional<TensorTable> best = takeBest(state);
  const bool has_passed_best = history.best_iteration != iteration && history.best_iteration > 0 &&
                               !model_->isWholeAtItsEndOnly();
  if (best.has_value() != has_passed_best) {
    fail(ErrorCode::kFormat, "the checkpoint lacks the best state of its fit");
  }
  model_->restore(modelState(state));
  iteration_ = iteration;
  history_ = std::move(history);
  best_ = std::move(best);
}

uint64_t Trainer::memoryBytes() const {
  // The model, the best of it, and once more while a checkpoint is written.
  return 3 * model_->memoryBytes() + pictures_.bytes() +
         history_.records.capacity() * sizeof(FitRecord);
}

}  // namespace stipple
