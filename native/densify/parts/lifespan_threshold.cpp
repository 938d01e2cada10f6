// Based on: Sandu, Pathak, Soundararajan, TAD-GS, arXiv 2606.23212 (temporally adaptive threshold),
// by its released program. Differs: it goes with any part that has a threshold, also where views
// count alike.

#include "densify/parts/lifespan_threshold.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "densify/state_arrays.h"

namespace stipple {

namespace {

class LifespanThreshold final : public ControlPart {
 public:
  explicit LifespanThreshold(const LifespanThresholdOptions& options) : options_(options) {}

  const char* name() const override { return "lifespan_threshold"; }
  ControlRoles owns() const override { return roles(ControlRole::kThreshold); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (moment.is_learning) request.drawn_splats = request.lifespans = true;
  }

  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    const std::span<const float> lifespans = view.splats.lifespans;
    if (!moment.is_learning || lifespans.empty()) return;
    if (sums_.empty()) reset(lifespans.size());
    requireCount(lifespans.size());
    constexpr float kLeast = static_cast<float>(kVisibleOpacity);
    for (size_t i = 0; i < sums_.size(); ++i) {
      if (!view.visible[i] || !(view.splats.opacities[i] > kLeast)) continue;
      sums_[i] += lifespans[i];
      ++counts_[i];
    }
  }

  std::vector<float> thresholdShares(const ControlMoment&, size_t count) override {
    std::vector<float> shares(count, 1.0f);
    if (sums_.empty()) return shares;
    requireCount(count);
    for (size_t i = 0; i < count; ++i) {
      if (counts_[i] == 0) continue;
      const double mean = static_cast<double>(sums_[i]) / static_cast<double>(counts_[i]);
      const double part = std::pow(std::clamp(mean, 0.0, 1.0), options_.power);
      shares[i] = static_cast<float>(options_.least + (1 - options_.least) * part);
    }
    return shares;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    if (sums_.empty()) return;
    const size_t count = edit.countAfter(count_before);
    if (moment.is_event || count != count_before) reset(count);
  }

  void put(TensorTable& table) const override {
    table["lifespan_sums"] = {{sums_.size()}, sums_};
    table["lifespan_counts"] = {{counts_.size()}, counts_};
  }
  void take(const TensorTable& table) override {
    std::vector<float> sums = stateSums<float>(table, "lifespan_sums");
    std::vector<uint32_t> counts = stateArray<uint32_t>(table, "lifespan_counts");
    requireAsMany(sums.size(), "lifespan_sums", counts.size(), "lifespan_counts");
    sums_ = std::move(sums);
    counts_ = std::move(counts);
  }

 private:
  void reset(size_t count) {
    sums_.assign(count, 0.0f);
    counts_.assign(count, 0);
  }
  void requireCount(size_t count) const {
    if (sums_.size() == count) return;
    fail(ErrorCode::kInternal, "the strategy's lifespans are of " + std::to_string(sums_.size()) +
                                   " splats, not of " + std::to_string(count));
  }

  LifespanThresholdOptions options_;
  std::vector<float> sums_;       ///< [N] empty: nothing moves, as far as is known
  std::vector<uint32_t> counts_;  ///< [N] views that showed the splat
};

}  // namespace

std::unique_ptr<ControlPart> makeLifespanThreshold(const LifespanThresholdOptions& options) {
  return std::make_unique<LifespanThreshold>(options);
}

}  // namespace stipple
