// Based on: Lu, Yu, Xu, Xiangli, Wang, Lin, Dai, Scaffold-GS: Structured 3D Gaussians for
// View-Adaptive Rendering, CVPR 2024, by its released program. Differs: docs/methods/anchors.md.
#include "train/anchors/scaffold_model.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/stopwatch.h"
#include "decode/anchors/scaffold_decoder.h"
#include "train/anchors/scaffold_steps.h"
#include "train/loop/view_evaluator.h"
#include "train/loop/view_step.h"
#include "train/prior/start_splats.h"

namespace stipple {

namespace {

/// Of putting anchors in order: views that are asked, and the share that each round leaves.
constexpr size_t kOrderViews = 32;
constexpr size_t kLeastOrdered = 64;
/// Budgets that are measured, from all anchors down by octaves.
constexpr int kMeasuredOctaves = 5;

void requireOptions(const ScaffoldModelOptions& options, std::span<const size_t> training) {
  if (training.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no views to learn from; at least one is needed");
  }
  if (!(options.ssim_share >= 0 && options.ssim_share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "ssim_share is " + std::to_string(options.ssim_share) + "; 0 to 1 is allowed");
  }
  if (options.most_anchors < 1) {
    fail(ErrorCode::kInvalidArgument, "max_anchors is 0; at least 1 is needed");
  }
}

class ScaffoldModel final : public FitModel {
 public:
  ScaffoldModel(const BackendFactory& backends, ScaffoldState state, double voxel,
                const ScaffoldModelOptions& options)
      : options_(options),
        voxel_(voxel),
        state_(std::move(state)),
        pass_(backends.makeViewPass()) {}

  const char* name() const override { return "scaffold"; }

  StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator*,
                  Progress* progress) override {
    if (beginsBudgets(moment)) {
      beginBudgets(state_);
      gradients_ = {};
    }
    const bool watches = watchesAnchors(moment);
    StepReport report;
    report.stage = "Anchors";
    {
      const TimedBlock watch(report.seconds.field);
      ScaffoldDecoder(state_.scaffold)
          .forward(*state_.scaffold, budgetOfStep(moment, options_.seed, state_.scaffold->size()),
                   tape_, cloud_);
    }
    StatisticRequest request;
    request.screen_gradients = watches;
    passOverView(*pass_, cloud_, view, request, options_.ssim_share, progress, report);
    if (watches) {
      const TimedBlock watch(report.seconds.edit);
      ViewStatistics statistics;
      pass_->lendStatistics(statistics);
      observeAnchors(statistics, *view.camera, tape_, cloud_.opacities, state_);
    }
    {
      const TimedBlock watch(report.seconds.field);
      pass_->swapGradients(cloud_gradient_);
      report.loss += regulariseSizes(moment, cloud_, cloud_gradient_);
      ScaffoldDecoder(state_.scaffold)
          .backward(*state_.scaffold, tape_, cloud_, cloud_gradient_, gradients_);
      pass_->swapGradients(cloud_gradient_);
    }
    {
      const TimedBlock watch(report.seconds.optimiser);
      learnAnchors(moment, gradients_, state_);
    }
    if (growsAnchors(moment)) {
      const TimedBlock watch(report.seconds.edit);
      growAnchors(moment, {voxel_, options_.most_anchors, options_.seed}, state_);
      gradients_ = {};
    }
    return report;
  }

  /// Budgets are learned until the end.
  bool isWholeAtItsEndOnly() const override { return true; }

  SplatCloud splats(uint64_t budget) override {
    const uint64_t all = state_.scaffold->size();
    const uint64_t wanted = budget == 0 ? drawn_anchors_.value_or(all) : budget;
    ScaffoldTape tape;
    SplatCloud cloud;
    ScaffoldDecoder(state_.scaffold)
        .forward(*state_.scaffold, static_cast<size_t>(std::min(wanted, all)), tape, cloud);
    return cloud;
  }

  std::vector<uint64_t> budgets() const override {
    std::vector<uint64_t> budgets;
    uint64_t budget = state_.scaffold->size();
    for (int octave = 0; octave <= kMeasuredOctaves && budget > 0; ++octave, budget /= 2) {
      budgets.insert(budgets.begin(), budget);
    }
    return budgets;
  }

  /// Where no budgets were learned: half of the anchors after half, those that cost least to
  /// remove. What each of the others is worth is asked again each time, since it depends on which
  /// others are there.
  void finish(FitViewEvaluator& views) override {
    if (state_.scaffold->coarsening > 0) return;
    const size_t all = state_.scaffold->size();
    for (size_t left = all; left > 0;) {
      drawn_anchors_ = left;
      std::vector<uint32_t> rows = orderOfWorth(worthOf(views, left));
      for (size_t i = left; i < all; ++i) rows.push_back(static_cast<uint32_t>(i));
      state_.keep(rows);
      if (left <= kLeastOrdered) break;
      left /= 2;
    }
    drawn_anchors_.reset();
  }

  TensorTable state() const override { return tensorsOf(state_); }

  void restore(const TensorTable& table) override {
    state_ = scaffoldStateOf(table, state_);
    gradients_ = {};
  }

  uint64_t memoryBytes() const override {
    // Values, both moments and derivatives.
    const uint64_t splats = cloud_.size() * (cloud_.shStride() + 11) * 3 * sizeof(float);
    return 4 * state_.scaffold->bytes() + splats + pass_->memoryBytes();
  }

  std::shared_ptr<const ScaffoldParameters> result() const {
    return std::make_shared<const ScaffoldParameters>(*state_.scaffold);
  }

 private:
  /// What the loss of the views would rise by without each of the first anchors, summed over its
  /// splats.
  std::vector<double> worthOf(FitViewEvaluator& views, size_t anchors) {
    std::vector<double> worth(anchors, 0.0);
    views.forgetSplats();
    ScaffoldTape tape;
    SplatCloud cloud;
    ScaffoldDecoder(state_.scaffold).forward(*state_.scaffold, anchors, tape, cloud);
    StatisticRequest request;
    request.contributions = true;
    const size_t count = std::min(views.viewCount(), kOrderViews);
    for (size_t k = 0; k < count; ++k) {
      const ViewStatistics& view = views.evaluate(k * views.viewCount() / count, request);
      const std::span<const float> contributions = view.of(Statistic::kContributions);
      for (size_t n = 0; n < tape.slots.size(); ++n) {
        // Negative where the splat lowers the error.
        worth[tape.slots[n] / state_.scaffold->gaussians] -= static_cast<double>(contributions[n]);
      }
    }
    return worth;
  }

  ScaffoldModelOptions options_;
  double voxel_;  ///< metres
  ScaffoldState state_;
  std::optional<uint64_t> drawn_anchors_;  ///< while anchors are put in order

  // Memory of steps, used again.
  std::unique_ptr<ViewPass> pass_;
  ScaffoldTape tape_;
  SplatCloud cloud_;
  SplatCloud cloud_gradient_;
  ScaffoldGradients gradients_;
};

}  // namespace

ScaffoldStart startOfScaffold(const ViewSource& views, std::span<const size_t> training,
                              const ScaffoldModelOptions& options, Progress* progress) {
  requireOptions(options, training);
  ScaffoldShape shape;
  shape.gaussians = options.gaussians_per_anchor;
  shape.sh_degree = options.sh_degree;
  shape.colour_space = views.colourSpace();
  shape.antialias = options.antialias;
  shape.seed = options.seed;
  ScaffoldStart start;
  start.scaffold = makeScaffold(shape);  // refuses options before any work
  StartOptions places;
  places.count = options.start_anchors;
  places.max_count = options.most_anchors;
  places.seed = options.seed;
  const StartSplats begin = startSplats(views, training, places, progress);
  start.voxel = voxelOf(begin.splats.positions);
  addStartingAnchors(begin.splats.positions, start.voxel, options.most_anchors, start.scaffold);
  return start;
}

std::unique_ptr<FitModel> makeScaffoldModel(const BackendFactory& backends, const ViewSource& views,
                                            std::span<const size_t> training,
                                            const ScaffoldModelOptions& options,
                                            Progress* progress) {
  ScaffoldStart start = startOfScaffold(views, training, options, progress);
  return std::make_unique<ScaffoldModel>(backends, startState(std::move(start.scaffold)),
                                         start.voxel, options);
}

std::shared_ptr<const ScaffoldParameters> scaffoldResult(const FitModel& model) {
  const auto* scaffold = dynamic_cast<const ScaffoldModel*>(&model);
  return scaffold ? scaffold->result() : nullptr;
}

}  // namespace stipple
