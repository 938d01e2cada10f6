// Based on: Kwak et al., MoRel, CVPR 2026 (arXiv 2512.09270): four stages over key-frame anchors.
// Differs: docs/methods/relay.md.
#include "train/anchors/relay_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/number_text.h"
#include "base/random.h"
#include "base/stopwatch.h"
#include "train/anchors/handed_on.h"
#include "train/anchors/passing_places.h"
#include "train/anchors/relay_parts.h"
#include "train/anchors/relay_segments.h"
#include "train/anchors/relay_work.h"
#include "train/anchors/scaffold_steps.h"
#include "train/loop/view_order.h"
#include "train/loop/view_step.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

/// Of the second half of the global stage and of windows, the share of steps that draw fewer
/// anchors. All of them are needed for what is to be learned (docs/methods/relay.md).
constexpr double kBudgetShare = 0.1;
/// Anchors that begin at what passes take this share of those that a key frame may have at most.
constexpr double kPassingShare = 0.5;
/// Budgets that are measured, by octaves.
constexpr int kMeasuredOctaves = 2;
/// Key frames that are kept at hand for drawing.
constexpr size_t kShownKeyFrames = 2;

void requireLevels(const RelayModelOptions& options) {
  const auto& [low, high] = options.level_quantiles;
  if (!(low >= 0 && low <= high && high <= 1)) {
    fail(ErrorCode::kInvalidArgument, "levels begin at ranks of " + numberText(low) + " and " +
                                          numberText(high) +
                                          "; ranks of 0 to 1 are allowed, the lower one first");
  }
  for (const double weight : options.level_weights) {
    if (weight >= 0 && weight <= 1) continue;
    fail(ErrorCode::kInvalidArgument,
         "a level has the weight " + numberText(weight) + "; 0 to 1 is allowed");
  }
}

class RelayModel final : public FitModel {
 public:
  RelayModel(const BackendFactory& backends, ScaffoldState start, double voxel,
             std::vector<double> times, PassingPlaces passing, const RelayModelOptions& options,
             std::shared_ptr<KeyFrameStore> store)
      : options_(options),
        voxel_(voxel),
        times_(std::move(times)),
        passing_(std::move(passing)),
        parts_(std::make_shared<RelayParts>(std::move(store),
                                            relaySegments(options.iterations, options.clip),
                                            shapeOf(*start.scaffold))),
        anchor_counts_(options.clip.keyCount(), start.scaffold->size()),
        pass_(backends.makeViewPass()) {
    work_.state = std::move(start);
  }

  const char* name() const override { return "relay"; }
  bool isWholeAtItsEndOnly() const override { return true; }
  bool moves() const override { return true; }

  std::optional<size_t> viewAt(uint64_t iteration) const override {
    const size_t index = segmentAt(iteration);
    const RelaySegment& segment = segments()[index];
    if (viewed_segment_ != index) {
      viewed_segment_ = index;
      viewed_ = viewsOfSegment(segment, options_.clip, times_);
      order_.emplace(viewed_.size(), mixBits(options_.anchors.seed ^ index));
    }
    const uint64_t taken = iteration - std::min(iteration, segment.begin);
    const double done =
        static_cast<double>(taken) / static_cast<double>(segment.end - segment.begin);
    const size_t count = viewsInReach(segment, options_.clip, times_, viewed_, done);
    if (count == viewed_.size()) return viewed_[order_->at(taken)];
    // Rounds of views that become more would not be even.
    const uint64_t seed = mixBits(options_.anchors.seed ^ index) + 1;
    return viewed_[keyedBits(seed, RandomUse::kViewOrder, taken) % count];
  }

  StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator*,
                  Progress* progress) override {
    enter(segmentAt(steps_));
    const RelaySegment& segment = segments()[*entered_];
    const FitMoment local = segment.local(momentOf(moment));
    StepReport report;
    if (segment.stage == RelayStage::kBlend) {
      report.stage = "Blending";
      blendStep(segment, local, view, progress, report);
    } else {
      static constexpr std::array<const char*, 4> kNames = {"", "Anchors", "Key frames", "Windows"};
      report.stage = kNames[static_cast<size_t>(segment.stage)];
      anchorStep(segment, local, view, progress, report);
    }
    ++steps_;
    if (steps_ == segment.end) leave(segment);
    return report;
  }

  SplatCloud splats(uint64_t budget) override { return splatsAt(budget, options_.clip.begin); }
  SplatCloud splatsAt(uint64_t budget, double seconds) override {
    return splatsOfClip(
        options_.clip, [this](uint32_t key) { return latest(key); }, seconds, budget);
  }

  std::vector<uint64_t> budgets() const override {
    uint64_t most = mostAnchors(options_.clip, anchor_counts_);
    std::vector<uint64_t> budgets;
    for (int octave = 0; octave <= kMeasuredOctaves && most > 0; ++octave, most /= 2) {
      budgets.insert(budgets.begin(), most);
    }
    return budgets;
  }

  TensorTable state() const override {
    TensorTable table = tensorsOf(work_);
    std::vector<uint64_t> counts(anchor_counts_.begin(), anchor_counts_.end());
    putValues("relay.anchor_counts", counts, table);
    putValues("relay.steps", std::vector<uint64_t>{steps_, entered_ ? *entered_ + 1 : uint64_t{0}},
              table);
    putValues("relay.first_key", std::vector<uint64_t>{options_.clip.first_key}, table);
    putValues("relay.hands_on", std::vector<uint64_t>{1}, table);
    return table;
  }

  void restore(const TensorTable& table) override {
    const auto at = takeValues<uint64_t>(table, "relay.steps", 2, 2);
    if (at[0] > options_.iterations + segments().size() || at[1] > segments().size()) {
      fail(ErrorCode::kFormat, "the checkpoint is of a fit of another length");
    }
    // Until 29 November 2026 it was frame 0, and checkpoints did not say so.
    if (!table.contains("relay.first_key") ||
        takeValues<uint64_t>(table, "relay.first_key", 1, 1)[0] != options_.clip.first_key) {
      fail(ErrorCode::kFormat,
           "the checkpoint is of a fit whose key frames stand at other frames; remove it to begin "
           "anew");
    }
    // Until 30 November 2026 all key frames came before all windows.
    if (!table.contains("relay.hands_on")) {
      fail(ErrorCode::kFormat,
           "the checkpoint is of a fit whose key frames all began alike; remove it to begin anew");
    }
    RelayWork work = workOf(table, work_);
    anchor_counts_ = takeValues<uint64_t>(table, "relay.anchor_counts", anchor_counts_.size(),
                                          anchor_counts_.size());
    work_ = std::move(work);
    steps_ = at[0];
    entered_.reset();
    if (at[1] > 0) entered_ = static_cast<size_t>(at[1] - 1);
    pair_ = {};
    if (entered_ && segments()[*entered_].stage == RelayStage::kBlend && !work_.blends.empty()) {
      loadPair(segments()[*entered_].key);
      for (size_t i = 0; i < 2; ++i) pair_[i]->blend = work_.blends[i];
    }
    forget();
  }

  uint64_t memoryBytes() const override {
    // Values, both moments and derivatives; the two that are shown.
    uint64_t bytes = 4 * work_.bytes() + pass_->memoryBytes();
    for (const auto& [key, frame] : shown_) bytes += frame->bytes();
    return bytes + cloud_.size() * (cloud_.shStride() + 11) * 3 * sizeof(float);
  }

  /// The last finished stage of a key frame, with what its blending has come to.
  std::shared_ptr<const KeyFrame> latest(uint32_t key) {
    for (const auto& [known, frame] : shown_) {
      if (known == key) return frame;
    }
    std::optional<KeyFrame> finished = parts_->latest(key, steps_);
    if (!finished) return std::make_shared<const KeyFrame>(keyFrameOf(work_));  // it changes yet
    auto frame = std::make_shared<const KeyFrame>(std::move(*finished));
    if (shown_.size() >= kShownKeyFrames) shown_.erase(shown_.begin());
    shown_.emplace_back(key, frame);
    return frame;
  }

  /// latest() of the fit as it is now, for as long as anybody has it.
  KeyFrameSource result() const {
    std::shared_ptr<const KeyFrame> under_way;
    if (!parts_->isFinished(RelayStage::kGlobal, 0, steps_)) {
      under_way = std::make_shared<const KeyFrame>(keyFrameOf(work_));
    }
    return [parts = parts_, steps = steps_, under_way](uint32_t key) {
      if (under_way) return under_way;
      return std::make_shared<const KeyFrame>(*parts->latest(key, steps));
    };
  }

 private:
  const std::vector<RelaySegment>& segments() const { return parts_->segments(); }

  size_t segmentAt(uint64_t steps) const {
    const auto found =
        std::upper_bound(segments().begin(), segments().end(), steps,
                         [](uint64_t at, const RelaySegment& one) { return at < one.end; });
    return static_cast<size_t>(
        std::min<std::ptrdiff_t>(found - segments().begin(), std::ssize(segments()) - 1));
  }

  /// Segments may take a few steps more than the fit has, where it has hardly any: the last one is
  /// then left short.
  FitMoment momentOf(FitMoment moment) const {
    moment.iteration = steps_ + 1;
    return moment;
  }

  void forget() {
    shown_.clear();
    gradients_ = {};
    deformation_gradients_ = {};
  }

  /// Gets what a segment begins with, where it is not at hand.
  void enter(size_t index) {
    if (entered_ == index) return;
    const RelaySegment& segment = segments()[index];
    forget();
    switch (segment.stage) {
      case RelayStage::kGlobal:
        break;
      case RelayStage::kKeyFrame:
        begin(startOfKeyFrame(segment.key), {});
        break;
      case RelayStage::kWindow: {
        const ScaffoldParameters& scaffold = *work_.state.scaffold;
        AnchorDeformation deformation = makeDeformation(planesOf(scaffold), scaffold.gaussians);
        begin(std::move(work_.state), std::move(deformation));
        break;
      }
      case RelayStage::kBlend:
        loadPair(segment.key);
        work_ = blendWorkOf(*pair_[0], *pair_[1], work_);
        break;
    }
    entered_ = index;
  }

  void begin(ScaffoldState state, AnchorDeformation deformation) {
    state.statistics = {};
    state.follow();
    work_ = workOn(std::move(state), std::move(deformation));
    if (options_.grows_by_level) {
      work_.state.levels =
          levelsOfFeatures(work_.state.scaffold->features, options_.level_quantiles);
    }
  }

  /// The global anchors, with what has been learned of them since, and anchors at what passes at
  /// the time of the key frame. Where there is no room, those that are faintest go. What is at hand
  /// until then is of the segment before: the global one, or the window of the key frame before.
  ScaffoldState startOfKeyFrame(uint32_t key) {
    // Read first: where it is not there, a checkpoint can still be written of what is at hand.
    std::optional<KeyFrame> global;
    if (key > 0) global = parts_->keyFrame(RelayStage::kGlobal, 0);
    ScaffoldState state = std::move(work_.state);
    if (global) state = handedOn(std::move(state), global->scaffold);
    const double about = kFramesAboutKey / options_.clip.frames_per_second;
    const double at = options_.clip.timeOf(key);
    const std::vector<float> places = passing_.between(at - about, at + about);
    if (places.empty()) return state;
    const uint64_t most = options_.anchors.most_anchors;
    const uint64_t room = std::min<uint64_t>(
        places.size() / 3, static_cast<uint64_t>(kPassingShare * static_cast<double>(most)));
    const uint64_t all = state.scaffold->size() + room;
    if (all > most) state.keep(allButFaintest(*state.scaffold, all - most));
    const size_t before = state.scaffold->features.size();
    addStartingAnchors(places, voxel_, room, *state.scaffold);
    const std::vector<float> faint = faintFeatures(state.scaffold->opacity);
    for (size_t i = before; i < state.scaffold->features.size(); ++i) {
      state.scaffold->features[i] = faint[i % kScaffoldFeatures];
    }
    state.follow();
    return state;
  }

  void loadPair(uint32_t key) {
    for (uint32_t i = 0; i < 2; ++i) {
      pair_[i] = std::make_unique<KeyFrame>(parts_->keyFrame(RelayStage::kWindow, key + i));
    }
  }

  /// A box about the anchors, and a moment for each frame of the window's half.
  HexPlaneShape planesOf(const ScaffoldParameters& scaffold) const {
    constexpr double kMargin = 0.05;
    HexPlaneShape planes;
    double longest = 1e-6;
    for (size_t axis = 0; axis < 3; ++axis) {
      float low = INFINITY, high = -INFINITY;
      for (size_t a = 0; a < scaffold.size(); ++a) {
        low = std::min(low, scaffold.positions[a * 3 + axis]);
        high = std::max(high, scaffold.positions[a * 3 + axis]);
      }
      planes.lowest[axis] = static_cast<double>(low);
      planes.highest[axis] = static_cast<double>(high);
      longest = std::max(longest, planes.highest[axis] - planes.lowest[axis]);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      planes.lowest[axis] -= kMargin * longest;
      planes.highest[axis] += kMargin * longest;
    }
    planes.moments = std::clamp<uint32_t>(options_.clip.spacing, 4, 64);
    planes.seed = options_.anchors.seed;
    return planes;
  }

  double tauOf(uint32_t key, double seconds) const {
    const KeyFrameClip& clip = options_.clip;
    const double frames = (seconds - clip.timeOf(key)) * clip.frames_per_second;
    return std::clamp(frames / clip.spacing, -1.0, 1.0);
  }

  void anchorStep(const RelaySegment& segment, const FitMoment& moment, const StepView& view,
                  Progress* progress, StepReport& report) {
    ScaffoldState& state = work_.state;
    const ScaffoldDecoder decoder(state.scaffold);
    const bool is_window = segment.stage == RelayStage::kWindow;
    size_t count = state.scaffold->size();
    if (segment.stage != RelayStage::kKeyFrame) {
      if (beginsBudgets(moment)) {
        beginBudgets(state);
        gradients_ = {};
      }
      count = budgetOfStep(moment, mixBits(options_.anchors.seed ^ *entered_), count, kBudgetShare);
    }
    {
      const TimedBlock watch(report.seconds.field);
      if (is_window) {
        deform(work_.deformation, *state.scaffold, count, tauOf(segment.key, view.time),
               deformation_tape_, deformed_);
      }
      decoder.forward(is_window ? deformed_ : *state.scaffold, count, tape_, cloud_);
    }
    StatisticRequest request;
    request.screen_gradients = watchesAnchors(moment);
    passOverView(*pass_, cloud_, view, request, options_.anchors.ssim_share, progress, report);
    if (request.screen_gradients) {
      const TimedBlock watch(report.seconds.edit);
      ViewStatistics statistics;
      pass_->lendStatistics(statistics);
      observeAnchors(statistics, *view.camera, tape_, cloud_.opacities, state);
    }
    {
      const TimedBlock watch(report.seconds.field);
      pass_->swapGradients(cloud_gradient_);
      report.loss += regulariseSizes(moment, cloud_, cloud_gradient_);
      decoder.backward(is_window ? deformed_ : *state.scaffold, tape_, cloud_, cloud_gradient_,
                       gradients_);
      pass_->swapGradients(cloud_gradient_);
      if (is_window) {
        deformBackward(work_.deformation, *state.scaffold, count, gradients_.anchors,
                       deformation_tape_, deformation_gradients_);
        report.loss += work_.deformation.planes.regularise(deformation_gradients_.planes);
      }
    }
    {
      const TimedBlock watch(report.seconds.optimiser);
      learnAnchors(moment, gradients_, state);
      if (is_window) learnDeformation(moment, deformation_gradients_, work_);
    }
    if (!growsAnchors(moment)) return;
    const TimedBlock watch(report.seconds.edit);
    AnchorGrowthLimits limits = {voxel_, options_.anchors.most_anchors, options_.anchors.seed};
    const double done =
        static_cast<double>(moment.iteration) / static_cast<double>(moment.iterations);
    for (size_t i = 0; i < options_.level_weights.size(); ++i) {
      const double first = options_.level_weights[i];
      limits.level_weights[i + 1] = first + (1 - first) * done;
    }
    growAnchors(moment, limits, state);
    gradients_ = {};
  }

  void blendStep(const RelaySegment& segment, const FitMoment& moment, const StepView& view,
                 Progress* progress, StepReport& report) {
    const double tau = std::max(0.0, tauOf(segment.key, view.time));
    const std::array<double, 2> taus = {tau, tau - 1};
    std::array<std::vector<float>, 2> fading, shares;
    std::array<size_t, 2> counts;
    {
      const TimedBlock watch(report.seconds.field);
      for (size_t i = 0; i < 2; ++i) {
        splatsOfKeyFrame(*pair_[i], pair_[i]->scaffold.size(), taus[i], pair_tapes_[i],
                         pair_clouds_[i]);
        fading[i] = fadingOf(*pair_[i], pair_[i]->scaffold.size(), taus[i], options_.clip.blend);
        counts[i] = pair_clouds_[i].size();
      }
      shares[0] = sharesOf(fading[0], fading[1]);
      shares[1] = sharesOf(fading[1], fading[0]);
      joinBlended(pair_clouds_, pair_tapes_, shares, pair_[0]->scaffold.gaussians, cloud_);
    }
    passOverView(*pass_, cloud_, view, {}, options_.anchors.ssim_share, progress, report);
    {
      const TimedBlock watch(report.seconds.field);
      pass_->swapGradients(cloud_gradient_);
      std::array<std::vector<float>, 2> by_shares, by_fading;
      for (size_t i = 0, n = 0; i < 2; ++i) {
        by_shares[i].assign(shares[i].size(), 0.0f);
        by_fading[i].assign(shares[i].size(), 0.0f);
        for (size_t k = 0; k < counts[i]; ++k, ++n) {
          by_shares[i][pair_tapes_[i].splats.slots[k] / pair_[i]->scaffold.gaussians] +=
              cloud_gradient_.opacities[n] * pair_clouds_[i].opacities[k];
        }
      }
      pass_->swapGradients(cloud_gradient_);
      sharesBackward(fading[0], fading[1], by_shares[0], by_fading[0], by_fading[1]);
      sharesBackward(fading[1], fading[0], by_shares[1], by_fading[1], by_fading[0]);
      for (size_t i = 0; i < 2; ++i) {
        by_blend_[i].assign(pair_[i]->blend.size(), 0.0f);
        fadingBackward(*pair_[i], taus[i], by_fading[i], by_blend_[i], options_.clip.blend);
      }
    }
    const TimedBlock watch(report.seconds.optimiser);
    learnBlend(moment, by_blend_, work_);
    for (size_t i = 0; i < 2; ++i) pair_[i]->blend = work_.blends[i];
  }

  /// Puts what a segment has made into the store.
  void leave(const RelaySegment& segment) {
    if (segment.stage == RelayStage::kBlend) {
      parts_->putBlends(segment, work_.blends);
    } else {
      const uint64_t count = work_.state.scaffold->size();
      if (segment.stage == RelayStage::kGlobal) {
        std::fill(anchor_counts_.begin(), anchor_counts_.end(), count);
      } else {
        anchor_counts_[segment.key] = count;
      }
      parts_->put(segment, keyFrameOf(work_));
    }
    forget();
  }

  RelayModelOptions options_;
  double voxel_;               ///< metres
  std::vector<double> times_;  ///< of the training views, seconds
  PassingPlaces passing_;
  std::shared_ptr<RelayParts> parts_;
  RelayWork work_;
  std::vector<uint64_t> anchor_counts_;  ///< of each key frame as it is now
  uint64_t steps_ = 0;
  std::optional<size_t> entered_;                  ///< the segment that work_ is of
  std::array<std::unique_ptr<KeyFrame>, 2> pair_;  ///< of the last stage
  std::vector<std::pair<uint32_t, std::shared_ptr<const KeyFrame>>> shown_;

  // Which views are looked at now.
  mutable size_t viewed_segment_ = SIZE_MAX;
  mutable std::vector<size_t> viewed_;
  mutable std::optional<ViewOrder> order_;

  // Memory of steps, used again.
  std::unique_ptr<ViewPass> pass_;
  ScaffoldTape tape_;
  DeformationTape deformation_tape_;
  AnchorArrays deformed_;
  SplatCloud cloud_, cloud_gradient_;
  ScaffoldGradients gradients_;
  DeformationGradients deformation_gradients_;
  std::array<KeyFrameTape, 2> pair_tapes_;
  std::array<SplatCloud, 2> pair_clouds_;
  std::array<std::vector<float>, 2> by_blend_;
};

}  // namespace

std::unique_ptr<FitModel> makeRelayModel(const BackendFactory& backends, const ViewSource& views,
                                         std::span<const size_t> training,
                                         const RelayModelOptions& options,
                                         std::shared_ptr<KeyFrameStore> store, Progress* progress) {
  validate(options.clip);
  requireLevels(options);
  const ScaffoldStart start = startOfScaffold(views, training, options.anchors, progress);
  std::vector<double> times;
  for (const size_t view : training) times.push_back(views.time(view));
  PassingPlaces passing = passingPlaces(views, training, options.anchors.seed, progress);
  return std::make_unique<RelayModel>(backends, startState(start.scaffold), start.voxel,
                                      std::move(times), std::move(passing), options,
                                      std::move(store));
}

KeyFrameSource relayResult(const FitModel& model) {
  const auto* relay = dynamic_cast<const RelayModel*>(&model);
  return relay ? relay->result() : nullptr;
}

}  // namespace stipple
