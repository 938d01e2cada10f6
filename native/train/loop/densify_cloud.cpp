// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2, and what followed it (densify/). Differs: statistics
// are of one look at every view, not of views between which splats move.

#include "train/loop/densify_cloud.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/error.h"
#include "densify/strategies.h"
#include "train/loop/backend_control.h"
#include "train/loop/contributions.h"
#include "train/loop/held_out.h"
#include "train/loop/picture_store.h"
#include "train/loop/view_evaluator.h"

namespace stipple {

namespace {

constexpr uint32_t kNew = UINT32_MAX;

class CloudDensifier {
 public:
  CloudDensifier(const BackendFactory& backends, const SplatCloud& cloud,
                 std::shared_ptr<const ViewSource> views, std::span<const size_t> shown,
                 const DensifyOptions& options, Progress* progress)
      : cloud_(cloud),
        shown_(shown.begin(), shown.end()),
        options_(options),
        progress_(progress),
        pictures_(std::move(views), options.picture_bytes),
        strategy_(makeStrategy(options.strategy)),
        backend_(backends.makeRenderBackend()),
        evaluator_(
            backends, [this] { return backend_->download(); }, pictures_, shown_, kBlack,
            options.ssim_share) {
    backend_->upload(cloud);
    beginControl(*backend_, *strategy_);
    origins_.resize(cloud.size());
    for (uint32_t i = 0; i < origins_.size(); ++i) origins_[i] = i;
    moment_.extent = extentOfCameras(pictures_.views(), shown_);
    moment_.centre = centreOfCameras(pictures_.views(), shown_);
    moment_.seed = options.seed;
    moment_.view_count = shown_.size();
    moment_.max_splats = densifyLimit(cloud.size(), options);
  }

  SplatCloud run() {
    for (uint64_t event = 0; event < options_.event_count; ++event) {
      moment_.standalone = StandaloneEvent{event, options_.event_count, false};
      sweep();
      for (size_t view = 0; view < shown_.size(); ++view) {
        advance(progress_, done(event, view), "Looking at views");
        look(view);
      }
      moment_.standalone->is_now = true;
      advance(progress_, done(event, shown_.size()), "Densifying");
      change();
    }
    moment_.standalone->is_now = false;
    sweep();  // for what looks at new splats
    advance(progress_, 1.0, "Densifying");
    return result();
  }

  /// At the splats that came out.
  SplatQuantities look() {
    SplatQuantities quantities = strategy_->seen(backend_->splatCount());
    evaluator_.forgetSplats();
    quantities.contribution = meanContributions(evaluator_, kContributionViews);
    return quantities;
  }

 private:
  static constexpr double kBlack[3] = {0, 0, 0};

  double done(uint64_t event, size_t views) const {
    const double of_event = static_cast<double>(views) / static_cast<double>(shown_.size() + 1);
    return (static_cast<double>(event) + of_event) / static_cast<double>(options_.event_count);
  }

  void look(size_t index) {
    pictures_.load(shown_[index], kBlack, target_);
    if (index + 1 < shown_.size()) pictures_.prefetch(shown_[index + 1]);
    const TrainingView looked_at{index, target_.width, target_.height, target_.colour};
    moment_.standalone->looks_left = shown_.size() - index;
    moment_.view = &looked_at;
    lookAt(index);
    moment_.view = nullptr;
  }

  void lookAt(size_t index) {
    const StatisticRequest request = strategy_->requests(moment_);
    if (!request.any()) return;
    RenderOptions drawing;
    drawing.with_depth = false;
    drawing.with_background = true;
    backend_->forward(pictures_.views().camera(shown_[index]), drawing);
    backend_->loss(target_.colour, lossFor(request, options_.ssim_share), target_.weights);
    backend_->backward(request);
    observeView(*backend_, *strategy_, moment_, index);
  }

  void change() {
    sweep();
    const std::optional<SplatEdit> edit = strategy_->edit(moment_, storeOf(*backend_));
    applyControl(*backend_, *strategy_, moment_, edit);
    if (edit) follow(*edit);
  }

  void sweep() {
    if (!strategy_->wantsSweep(moment_)) return;
    evaluator_.forgetSplats();
    strategy_->sweep(moment_, evaluator_);
    if (strategy_->parameterisation()) backend_->parameterise(strategy_->parameterisation());
  }

  /// Which splats are still those of the cloud.
  void follow(const SplatEdit& edit) {
    for (const RowWrite& write : edit.writes) {
      for (const uint32_t row : write.rows) origins_[row] = kNew;
    }
    if (edit.keep) {
      std::vector<uint32_t> kept;
      kept.reserve(edit.keep->size());
      for (const uint32_t row : *edit.keep) kept.push_back(origins_[row]);
      origins_ = std::move(kept);
    }
    origins_.resize(origins_.size() + edit.append.size(), kNew);
  }

  SplatCloud result() const {
    SplatCloud cloud = backend_->download();
    if (strategy_->parameterisation()) return cloud;
    // Logarithm and exponential do not give the same bits back.
    for (size_t i = 0; i < origins_.size(); ++i) {
      if (origins_[i] == kNew) continue;
      std::copy_n(&cloud_.scales[origins_[i] * size_t{3}], 3, &cloud.scales[i * 3]);
      cloud.opacities[i] = cloud_.opacities[origins_[i]];
    }
    return cloud;
  }

  const SplatCloud& cloud_;
  std::vector<size_t> shown_;
  DensifyOptions options_;
  Progress* progress_;
  PictureStore pictures_;
  std::unique_ptr<Strategy> strategy_;  ///< outlives the backend, which draws by its activations
  std::unique_ptr<RenderBackend> backend_;
  FitViewEvaluator evaluator_;
  TargetPicture target_;
  FitMoment moment_;
  std::vector<uint32_t> origins_;  ///< [N] row of the cloud, or kNew
};

}  // namespace

SplatCloud densifyCloud(const BackendFactory& backends, const SplatCloud& cloud,
                        std::shared_ptr<const ViewSource> views, std::span<const size_t> shown,
                        const DensifyOptions& options, Progress* progress, SplatQuantities* seen) {
  requireDensifiable(cloud, *views, options);
  if (shown.empty()) {
    fail(ErrorCode::kInvalidArgument, "there are no views to look at; at least one is needed");
  }
  CloudDensifier densifier(backends, cloud, std::move(views), shown, options, progress);
  SplatCloud made = densifier.run();
  if (seen) *seen = densifier.look();
  return made;
}

void requireDensifiable(const SplatCloud& cloud, const ViewSource& views,
                        const DensifyOptions& options) {
  if (cloud.size() == 0) {
    fail(ErrorCode::kInvalidArgument, "the cloud has no splats; at least one is needed");
  }
  if (cloud.colour_space != views.colourSpace()) {
    fail(ErrorCode::kInvalidArgument,
         "the cloud and the views have different colour spaces; they must be composited in one");
  }
  if (options.max_splats > 0 && options.max_splats < cloud.size()) {
    fail(ErrorCode::kInvalidArgument, "at most " + std::to_string(options.max_splats) +
                                          " splats are asked for; the cloud has " +
                                          std::to_string(cloud.size()) + " already");
  }
  if (options.event_count < 1 || options.event_count > kMaxDensifyEvents) {
    fail(ErrorCode::kInvalidArgument, "event count is " + std::to_string(options.event_count) +
                                          "; 1 to " + std::to_string(kMaxDensifyEvents) +
                                          " is allowed");
  }
  if (!(options.ssim_share >= 0 && options.ssim_share <= 1)) {
    fail(ErrorCode::kInvalidArgument,
         "ssim_share is " + std::to_string(options.ssim_share) + "; 0 to 1 is allowed");
  }
}

uint64_t densifyLimit(uint64_t count, const DensifyOptions& options) {
  return options.max_splats > 0 ? options.max_splats : 2 * count;
}

}  // namespace stipple
