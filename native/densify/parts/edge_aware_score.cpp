// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, section 3.1, with the constants and the normalisation
// of its published program. Differs: views are those of the iterations before an event, whose
// backward pass is taken anyway, instead of as many that are drawn again; what is not seen there is
// drawn only where every view counts.

#include "densify/parts/edge_aware_score.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "densify/quantities/edge_weights.h"
#include "densify/state_arrays.h"

namespace stipple {

namespace {

class EdgeAwareScore final : public ControlPart {
 public:
  explicit EdgeAwareScore(const EdgeAwareScoreOptions& options) : options_(options) {}

  const char* name() const override { return "edge_aware_score"; }
  ControlRoles owns() const override { return roles(ControlRole::kScore); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (!looks(moment) || !moment.view) return;
    const TrainingView& view = *moment.view;
    if (hasSeen(view.index)) return;
    request.edge_weights = edgeWeights(view.width, view.height, view.target);
  }

  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (looks(moment) && !view.of(Statistic::kEdgeWeights).empty()) add(view);
  }

  bool wantsSweep(const ControlMoment& moment) const override {
    return moment.is_event && !isLate(moment) && countsEveryView(moment);
  }
  void sweep(const ControlMoment&, ViewEvaluator& views) override {
    for (size_t view = 0; view < views.viewCount(); ++view) {
      if (hasSeen(view)) continue;
      const Camera& camera = views.camera(view);
      StatisticRequest request;
      request.edge_weights = edgeWeights(camera.width, camera.height, views.target(view));
      add(views.evaluate(view, request));
    }
  }

  std::vector<double> score(const ControlMoment& moment, const RawSplats& splats,
                            std::span<const Candidate> candidates) override {
    std::vector<double> weights(candidates.size(), 0.0);
    bool any = false;
    for (size_t k = 0; k < weights.size() && sums_.size() == splats.size(); ++k) {
      weights[k] = static_cast<double>(sums_[candidates[k].row]);
      any |= weights[k] > 0;
    }
    if (any && !isLate(moment)) return weights;
    for (size_t k = 0; k < weights.size(); ++k) {
      weights[k] = static_cast<double>(candidates[k].strength);
    }
    return weights;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    for (std::vector<float>* values : {&sums_, &shown_}) {
      if (values->size() == count_before) followEdit(edit, 1, 0.0f, *values);
    }
    if (!moment.is_event) return;
    shown_ = std::move(sums_);
    sums_.clear();
    views_.clear();
  }

  /// The scores are those of the last event; new splats have 0.
  std::vector<float> scores() const override { return shown_; }

  void put(TensorTable& table) const override {
    table["edge_sums"] = {{sums_.size()}, sums_};
    table["views"] = {{views_.size()}, views_};
  }
  void take(const TensorTable& table) override {
    std::vector<float> sums = stateSums<float>(table, "edge_sums");
    views_ = stateArray<uint64_t>(table, "views");
    sums_ = std::move(sums);
  }

 private:
  bool isLate(const ControlMoment& moment) const { return moment.isAfter(options_.late_after); }

  /// Whether the event that comes next, or this one, is the first after a recovery.
  bool countsEveryView(const ControlMoment& moment) const {
    const uint64_t event = moment.iteration + moment.until_event;
    return recoversWithin(event - std::min(event, moment.interval), event, moment.iterations,
                          options_.recovery);
  }

  /// Whether this iteration's view counts for the next event.
  bool looks(const ControlMoment& moment) const {
    if (moment.until_event == UINT64_MAX || isLate(moment)) return false;
    return moment.until_event < options_.views ||
           (moment.until_event < moment.interval && countsEveryView(moment));
  }

  bool hasSeen(size_t view) const {
    return std::find(views_.begin(), views_.end(), view) != views_.end();
  }

  /// Views weigh the same, however many of their pixels are edges.
  void add(const ViewStatistics& view) {
    const std::span<const float> edges = view.of(Statistic::kEdgeWeights);
    if (sums_.empty()) sums_.assign(edges.size(), 0.0f);
    if (sums_.size() != edges.size()) {
      fail(ErrorCode::kInternal, "the strategy's scores are of " + std::to_string(sums_.size()) +
                                     " splats; the view is of " + std::to_string(edges.size()));
    }
    views_.push_back(view.view);
    double sum = 0;
    size_t positive = 0;
    for (const float edge : edges) {
      sum += edge > 0 ? static_cast<double>(edge) : 0.0;
      positive += edge > 0;
    }
    if (positive == 0) return;
    const float scale = static_cast<float>(static_cast<double>(positive) / sum);
    for (size_t i = 0; i < edges.size(); ++i) {
      if (view.visible[i] && edges[i] > 0) sums_[i] += edges[i] * scale;
    }
  }

  EdgeAwareScoreOptions options_;
  std::vector<float> sums_;      ///< [N] since the last event; empty: no view has been looked at
  std::vector<uint64_t> views_;  ///< that have been looked at since
  std::vector<float> shown_;     ///< [N]
};

}  // namespace

std::unique_ptr<ControlPart> makeEdgeAwareScore(const EdgeAwareScoreOptions& options) {
  return std::make_unique<EdgeAwareScore>(options);
}

}  // namespace stipple
