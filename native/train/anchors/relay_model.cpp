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
#include "base/random.h"
#include "base/stopwatch.h"
#include "train/anchors/relay_segments.h"
#include "train/anchors/relay_work.h"
#include "train/anchors/scaffold_steps.h"
#include "train/loop/view_order.h"
#include "train/loop/view_step.h"
#include "train/networks/trainer_tensors.h"

namespace stipple {

namespace {

/// Weights of growth by level at the begin of a segment; they rise to 1 at its end.
constexpr std::array<double, 3> kLevelWeights = {1, 0.5, 0.25};
/// Of a window, the share of steps in which it is asked what anchors are worth.
constexpr double kWorthFrom = 0.8;
/// Budgets that are measured, by octaves.
constexpr int kMeasuredOctaves = 2;
/// Key frames that are kept at hand for drawing.
constexpr size_t kShownKeyFrames = 2;

class RelayModel final : public FitModel {
 public:
  RelayModel(const BackendFactory& backends, ScaffoldState start, double voxel,
             std::vector<double> times, const RelayModelOptions& options,
             std::shared_ptr<KeyFrameStore> store)
      : options_(options),
        voxel_(voxel),
        times_(std::move(times)),
        segments_(relaySegments(options.iterations, options.clip)),
        store_(std::move(store)),
        anchor_counts_(options.clip.keyCount(), start.scaffold->size()),
        pass_(backends.makeViewPass()) {
    work_.state = std::move(start);
  }

  const char* name() const override { return "relay"; }
  bool isWholeAtItsEndOnly() const override { return true; }
  bool moves() const override { return true; }

  std::optional<size_t> viewAt(uint64_t iteration) const override {
    const size_t index = segmentAt(iteration);
    const RelaySegment& segment = segments_[index];
    if (viewed_segment_ != index) {
      viewed_segment_ = index;
      viewed_ = viewsOfSegment(segment, options_.clip, times_);
      order_.emplace(viewed_.size(), mixBits(options_.anchors.seed ^ index));
    }
    return viewed_[order_->at(iteration - std::min(iteration, segment.begin))];
  }

  StepReport step(const FitMoment& moment, const StepView& view, ViewEvaluator*,
                  Progress* progress) override {
    enter(segmentAt(steps_));
    const RelaySegment& segment = segments_[*entered_];
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
    return table;
  }

  void restore(const TensorTable& table) override {
    const auto at = takeValues<uint64_t>(table, "relay.steps", 2, 2);
    if (at[0] > options_.iterations + segments_.size() || at[1] > segments_.size()) {
      fail(ErrorCode::kFormat, "the checkpoint is of a fit of another length");
    }
    RelayWork work = workOf(table, work_);
    anchor_counts_ = takeValues<uint64_t>(table, "relay.anchor_counts", anchor_counts_.size(),
                                          anchor_counts_.size());
    work_ = std::move(work);
    steps_ = at[0];
    entered_.reset();
    if (at[1] > 0) entered_ = static_cast<size_t>(at[1] - 1);
    pair_ = {};
    if (entered_ && segments_[*entered_].stage == RelayStage::kBlend && !work_.blends.empty()) {
      loadPair(segments_[*entered_].key);
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
    auto frame = std::make_shared<KeyFrame>(load(key));
    if (!isFinished(RelayStage::kGlobal, key)) return frame;  // it changes with every step
    for (uint32_t pair = key > 0 ? key - 1 : 0; pair <= key; ++pair) takeBlend(pair, key, *frame);
    if (shown_.size() >= kShownKeyFrames) shown_.erase(shown_.begin());
    shown_.emplace_back(key, frame);
    return frame;
  }

 private:
  size_t segmentAt(uint64_t steps) const {
    const auto found =
        std::upper_bound(segments_.begin(), segments_.end(), steps,
                         [](uint64_t at, const RelaySegment& one) { return at < one.end; });
    return static_cast<size_t>(
        std::min<std::ptrdiff_t>(found - segments_.begin(), std::ssize(segments_) - 1));
  }

  /// Segments may take a few steps more than the fit has, where it has hardly any: the last one is
  /// then left short.
  FitMoment momentOf(FitMoment moment) const {
    moment.iteration = steps_ + 1;
    return moment;
  }

  static std::string nameOf(RelayStage stage, uint32_t key) {
    if (stage == RelayStage::kGlobal) return "global";
    return (stage == RelayStage::kBlend ? "pair" : "key") + std::to_string(key) + ".stage" +
           std::to_string(static_cast<uint32_t>(stage));
  }

  TensorTable need(RelayStage stage, uint32_t key) const {
    std::optional<TensorTable> table = store_->get(nameOf(stage, key));
    if (table) return std::move(*table);
    fail(ErrorCode::kFormat,
         "the fit cannot go on: of its key frames, '" + nameOf(stage, key) + "' is not there");
  }

  ScaffoldShape shape() const {
    const ScaffoldParameters& scaffold = *work_.state.scaffold;
    return {scaffold.gaussians, scaffold.sh_degree, scaffold.colour_space, scaffold.antialias, 0};
  }

  /// The newest that there is of a key frame, without blending of its own.
  KeyFrame load(uint32_t key) const {
    for (const RelayStage stage :
         {RelayStage::kWindow, RelayStage::kKeyFrame, RelayStage::kGlobal}) {
      if (!isFinished(stage, key)) continue;
      return keyFrameOfTensors(need(stage, key), "", shape());
    }
    return keyFrameOf(work_);  // the global anchors, which are under way
  }

  bool isFinished(RelayStage stage, uint32_t key) const {
    for (const RelaySegment& segment : segments_) {
      if (segment.stage == stage && (segment.key == key || stage == RelayStage::kGlobal)) {
        return segment.end <= steps_;
      }
    }
    return false;
  }

  /// Of pair `pair`, what belongs to the key frame: forward numbers to its first, backward ones to
  /// its second.
  void takeBlend(uint32_t pair, uint32_t key, KeyFrame& frame) const {
    if (!isFinished(RelayStage::kBlend, pair)) return;
    const TensorTable table = need(RelayStage::kBlend, pair);
    const bool is_first = pair == key;
    const std::vector<float> blend = takeValues<float>(table, is_first ? "blend.0" : "blend.1",
                                                       frame.blend.size(), frame.blend.size());
    for (size_t i = is_first ? 0 : 2; i < blend.size(); i += kBlendNumbers) {
      frame.blend[i] = blend[i];
      frame.blend[i + 1] = blend[i + 1];
    }
  }

  void forget() {
    shown_.clear();
    gradients_ = {};
    deformation_gradients_ = {};
  }

  /// Gets what a segment begins with, where it is not at hand.
  void enter(size_t index) {
    if (entered_ == index) return;
    const RelaySegment& segment = segments_[index];
    forget();
    switch (segment.stage) {
      case RelayStage::kGlobal:
        break;
      case RelayStage::kKeyFrame:
        begin(keyFrameOfTensors(need(RelayStage::kGlobal, 0), "", shape()));
        break;
      case RelayStage::kWindow: {
        KeyFrame frame = keyFrameOfTensors(need(RelayStage::kKeyFrame, segment.key), "", shape());
        frame.deformation = makeDeformation(planesOf(frame.scaffold), frame.scaffold.gaussians);
        begin(std::move(frame));
        break;
      }
      case RelayStage::kBlend:
        loadPair(segment.key);
        work_ = blendWorkOf(*pair_[0], *pair_[1], work_);
        break;
    }
    entered_ = index;
  }

  void begin(KeyFrame frame) {
    work_ = workOn(std::move(frame));
    if (options_.grows_by_level) {
      work_.state.levels = levelsOfFeatures(work_.state.scaffold->features);
    }
  }

  void loadPair(uint32_t key) {
    for (uint32_t i = 0; i < 2; ++i) {
      pair_[i] = std::make_unique<KeyFrame>(
          keyFrameOfTensors(need(RelayStage::kWindow, key + i), "", shape()));
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
    const size_t count = state.scaffold->size();
    {
      const TimedBlock watch(report.seconds.field);
      if (is_window) {
        deform(work_.deformation, *state.scaffold, count, tauOf(segment.key, view.time),
               deformation_tape_, deformed_);
      }
      decoder.forward(is_window ? deformed_ : *state.scaffold, count, tape_, cloud_);
    }
    const double done =
        static_cast<double>(moment.iteration) / static_cast<double>(moment.iterations);
    StatisticRequest request;
    request.screen_gradients = watchesAnchors(moment);
    request.contributions = is_window && done > kWorthFrom;
    passOverView(*pass_, cloud_, view, request, options_.anchors.ssim_share, progress, report);
    if (request.any()) {
      const TimedBlock watch(report.seconds.edit);
      ViewStatistics statistics;
      pass_->lendStatistics(statistics);
      if (request.screen_gradients) {
        observeAnchors(statistics, *view.camera, tape_, cloud_.opacities, state);
      }
      if (request.contributions) weigh(statistics);
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
    for (size_t level = 0; level < limits.level_weights.size(); ++level) {
      limits.level_weights[level] = kLevelWeights[level] + (1 - kLevelWeights[level]) * done;
    }
    growAnchors(moment, limits, state);
    gradients_ = {};
  }

  /// What an anchor does to the error, added up over the steps of a window's end.
  void weigh(const ViewStatistics& statistics) {
    work_.worth.resize(work_.state.scaffold->size(), 0.0);
    const std::span<const float> contributions = statistics.of(Statistic::kContributions);
    for (size_t n = 0; n < tape_.slots.size(); ++n) {
      work_.worth[tape_.slots[n] / work_.state.scaffold->gaussians] -=
          static_cast<double>(contributions[n]);
    }
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
        fading[i] = fadingOf(*pair_[i], pair_[i]->scaffold.size(), taus[i]);
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
        fadingBackward(*pair_[i], taus[i], by_fading[i], by_blend_[i]);
      }
    }
    const TimedBlock watch(report.seconds.optimiser);
    learnBlend(moment, by_blend_, work_);
    for (size_t i = 0; i < 2; ++i) pair_[i]->blend = work_.blends[i];
  }

  /// Puts what a segment has made into the store.
  void leave(const RelaySegment& segment) {
    if (segment.stage == RelayStage::kBlend) {
      TensorTable table;
      putValues("blend.0", work_.blends[0], table);
      putValues("blend.1", work_.blends[1], table);
      store_->put(nameOf(segment.stage, segment.key), table);
    } else {
      if (segment.stage == RelayStage::kWindow) {
        work_.worth.resize(work_.state.scaffold->size(), 0.0);
        work_.state.keep(orderOfWorth(work_.worth));
        work_.worth.clear();
      }
      const uint64_t count = work_.state.scaffold->size();
      if (segment.stage == RelayStage::kGlobal) {
        std::fill(anchor_counts_.begin(), anchor_counts_.end(), count);
      } else {
        anchor_counts_[segment.key] = count;
      }
      store_->put(nameOf(segment.stage, segment.key), tensorsOfKeyFrame(keyFrameOf(work_), ""));
    }
    forget();
  }

  RelayModelOptions options_;
  double voxel_;               ///< metres
  std::vector<double> times_;  ///< of the training views, seconds
  std::vector<RelaySegment> segments_;
  std::shared_ptr<KeyFrameStore> store_;
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
  const ScaffoldStart start = startOfScaffold(views, training, options.anchors, progress);
  std::vector<double> times;
  for (const size_t view : training) times.push_back(views.time(view));
  return std::make_unique<RelayModel>(backends, startState(start.scaffold), start.voxel,
                                      std::move(times), options, std::move(store));
}

KeyFrameSource relayResult(FitModel& model) {
  auto* relay = dynamic_cast<RelayModel*>(&model);
  if (relay == nullptr) return nullptr;
  return [relay](uint32_t key) { return relay->latest(key); };
}

}  // namespace stipple
