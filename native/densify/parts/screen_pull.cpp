// Based on: Kerbl, Kopanas, Leimkuehler, Drettakis, 3D Gaussian Splatting for Real-Time Radiance
// Field Rendering, SIGGRAPH 2023, section 5.2; two statistics: Ye, Li, Liu, Dou, Zhang, Zhang,
// AbsGS, ACM MM 2024, section 4; views that count by opacity: Sandu, Pathak, Soundararajan, TAD-GS,
// arXiv 2606.23212, by its released program.

#include "densify/parts/screen_pull.h"

#include <optional>

#include "densify/parts/clone_or_split.h"
#include "densify/quantities/gradient_window.h"

namespace stipple {

namespace {

class ScreenPull final : public ControlPart {
 public:
  explicit ScreenPull(const ScreenPullOptions& options)
      : options_(options), copy_window_(options.copy_statistic, options.least_opacity) {
    if (options.split_statistic != options.copy_statistic) {
      split_window_.emplace(options.split_statistic, options.least_opacity);
    }
  }

  const char* name() const override {
    return options_.least_opacity ? "visibility_weighted_score" : "screen_pull";
  }
  ControlRoles owns() const override { return roles(ControlRole::kMultiplication); }
  bool heedsThresholds() const override { return true; }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (!moment.is_learning) return;
    for (const Statistic one : {options_.copy_statistic, options_.split_statistic}) {
      (one == Statistic::kScreenGradients ? request.screen_gradients
                                          : request.absolute_screen_gradients) = true;
    }
    if (options_.least_opacity) request.drawn_splats = true;
  }

  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (!moment.is_learning) return;
    copy_window_.add(view);
    if (split_window_) split_window_->add(view);
  }

  std::vector<Candidate> candidates(const ControlMoment& moment, const RawSplats& splats) override {
    if (copy_window_.size() == 0) copy_window_.reset(splats.size());
    if (split_window_ && split_window_->size() == 0) split_window_->reset(splats.size());
    const GradientWindow& split_window = split_window_ ? *split_window_ : copy_window_;
    copy_window_.requireCount(splats.size());
    split_window.requireCount(splats.size());
    const float small = logShareOfExtent(moment, options_.small_share);
    const bool is_late = options_.late_after > 0 && moment.isAfter(options_.late_after);
    const double share = is_late ? options_.late_share : 1.0;
    const float copy_threshold = static_cast<float>(share * options_.copy_threshold);
    const float split_threshold = static_cast<float>(share * options_.split_threshold);
    std::vector<Candidate> found;
    score_.assign(splats.size(), 0.0f);
    for (uint32_t i = 0; i < splats.size(); ++i) {
      const bool is_large = largestLogScale(splats, i) > small;
      const float own = moment.threshold_shares.empty() ? 1.0f : moment.threshold_shares[i];
      const float pull = (is_large ? split_window.average(i) / split_threshold
                                   : copy_window_.average(i) / copy_threshold) /
                         own;
      score_[i] = pull;
      if (pull >= 1) found.push_back({i, pull, is_large});
    }
    return found;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    copy_window_.edited(moment, edit, count_before);
    if (split_window_) split_window_->edited(moment, edit, count_before);
    if (score_.size() == count_before) followEdit(edit, 1, 0.0f, score_);
  }

  /// The scores are those of the last event, in units of the threshold.
  std::vector<float> scores() const override { return score_; }

  void put(TensorTable& table) const override {
    copy_window_.put(table);
    if (split_window_) {
      TensorTable split;
      split_window_->put(split);
      for (auto& [key, tensor] : split) table["split_" + key] = std::move(tensor);
    }
  }
  void take(const TensorTable& table) override {
    std::optional<GradientWindow> split = split_window_;
    if (split) {
      TensorTable own;
      for (const auto& [key, tensor] : table) {
        if (key.starts_with("split_")) own[key.substr(6)] = tensor;
      }
      split->take(own);
    }
    copy_window_.take(table);
    split_window_ = std::move(split);
  }

 private:
  ScreenPullOptions options_;
  GradientWindow copy_window_;
  std::optional<GradientWindow> split_window_;  ///< where it is of another statistic
  std::vector<float> score_;                    ///< [N]
};

}  // namespace

std::unique_ptr<ControlPart> makeScreenPull(const ScreenPullOptions& options) {
  return std::make_unique<ScreenPull>(options);
}

}  // namespace stipple
