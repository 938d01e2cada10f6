// Based on: Zhou et al., Gradient-Direction-Aware Density Control for 3D Gaussian Splatting,
// ICLR 2026 (arXiv 2508.09239), with the constants of its published program. Differs: lengths are
// summed pixel by pixel, as the paper has it, so that turning a picture changes nothing; the
// program sums along each side, and adds 1e-8, by which faint gradients look as if they agreed.
// Directions are those in pixels, whose sides are equal; gradients count per half picture, as
// everywhere.

#include "densify/strategies/direction.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/quantities/gradient_window.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

/// How far the pixels of a splat agree about where it should go: length of the sum of what they ask
/// for over the sum of its lengths, in each view, added up over views.
class CoherenceWindow {
 public:
  void add(const ViewStatistics& view) {
    const size_t count = view.visible.size();
    if (lengths_.empty()) reset(count);
    if (lengths_.size() != count) {
      fail(ErrorCode::kInternal, "the strategy's statistics are of " +
                                     std::to_string(lengths_.size()) + " splats; the view is of " +
                                     std::to_string(count));
    }
    const std::span<const float> sums = view.of(Statistic::kScreenGradients);
    const std::span<const float> lengths = view.of(Statistic::kScreenGradientNorms);
    // Views weigh by their size, as in the gradients' unit.
    const float unit =
        0.5f * std::sqrt(static_cast<float>(view.width) * static_cast<float>(view.height));
    const auto add_range = [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!view.visible[i]) continue;
        aligned_[i] += unit * std::hypot(sums[i * 2], sums[i * 2 + 1]);
        lengths_[i] += unit * lengths[i];
      }
    };
    parallelFor(count, kGrain, std::cref(add_range));
  }

  void reset(size_t count) {
    aligned_.assign(count, 0.0f);
    lengths_.assign(count, 0.0f);
  }

  size_t size() const { return lengths_.size(); }

  /// 0..1; 1 where nothing pulls.
  double coherence(size_t splat) const {
    const double length = static_cast<double>(lengths_[splat]);
    return length > 0 ? std::min(1.0, static_cast<double>(aligned_[splat]) / length) : 1.0;
  }

  void put(TensorTable& table) const {
    table["aligned_sums"] = {{aligned_.size()}, aligned_};
    table["length_sums"] = {{lengths_.size()}, lengths_};
  }
  void take(const TensorTable& table) {
    std::vector<float> aligned = stateSums<float>(table, "aligned_sums");
    std::vector<float> lengths = stateSums<float>(table, "length_sums");
    requireAsMany(aligned.size(), "aligned_sums", lengths.size(), "length_sums");
    aligned_ = std::move(aligned);
    lengths_ = std::move(lengths);
  }

 private:
  std::vector<float> aligned_;  ///< [N]
  std::vector<float> lengths_;  ///< [N]
};

class DirectionPull final : public ControlPart {
 public:
  explicit DirectionPull(const DirectionPullOptions& options) : options_(options) {}

  const char* name() const override { return "direction_pull"; }
  ControlRoles owns() const override { return roles(ControlRole::kMultiplication); }
  bool heedsThresholds() const override { return true; }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (!moment.is_learning) return;
    request.screen_gradients = request.absolute_screen_gradients = true;
  }

  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (!moment.is_learning) return;
    pull_.add(view);
    coherence_.add(view);
  }

  std::vector<Candidate> candidates(const ControlMoment& moment, const RawSplats& splats) override {
    if (pull_.size() == 0) pull_.reset(splats.size());
    if (coherence_.size() == 0) coherence_.reset(splats.size());
    const float small = logShareOfExtent(moment, options_.small_share);
    std::vector<Candidate> found;
    score_.assign(splats.size(), 0.0f);
    for (uint32_t i = 0; i < splats.size(); ++i) {
      const bool is_large = largestLogScale(splats, i) > small;
      const double weight = directionWeight(options_, coherence_.coherence(i));
      const double own =
          moment.threshold_shares.empty() ? 1.0 : static_cast<double>(moment.threshold_shares[i]);
      const double gradient = static_cast<double>(pull_.average(i)) / (own * options_.threshold);
      score_[i] = static_cast<float>(is_large ? gradient * weight : gradient / weight);
      if (score_[i] >= 1) found.push_back({i, score_[i], is_large});
    }
    return found;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    pull_.edited(moment, edit, count_before);
    const size_t count = edit.countAfter(count_before);
    if (moment.is_event || count != count_before) coherence_.reset(count);
    if (score_.size() == count_before) followEdit(edit, 1, 0.0f, score_);
  }

  /// The scores are those of the last event, in units of the threshold.
  std::vector<float> scores() const override { return score_; }

  void put(TensorTable& table) const override {
    pull_.put(table);
    coherence_.put(table);
  }
  void take(const TensorTable& table) override {
    GradientWindow pull = pull_;
    pull.take(table);
    coherence_.take(table);
    pull_ = std::move(pull);
  }

 private:
  DirectionPullOptions options_;
  GradientWindow pull_{Statistic::kScreenGradients};
  CoherenceWindow coherence_;
  std::vector<float> score_;  ///< [N]
};

}  // namespace

double directionWeight(const DirectionPullOptions& options, double coherence) {
  return options.base + options.gain * std::pow(1 - std::clamp(coherence, 0.0, 1.0), options.power);
}

std::unique_ptr<ControlPart> makeDirectionPull(const DirectionPullOptions& options) {
  return std::make_unique<DirectionPull>(options);
}

ControlAssembly directionControl(const DirectionOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeDirectionPull(options.pull));
  addPart(assembly, makeCloneOrSplit(options.children));
  addPart(assembly, makeFaintRemoval(options.removal));
  addPart(assembly, makeOpacityReset(options.reset));
  return assembly;
}

ControlAssembly directionControl(StrategySettings& settings) {
  DirectionOptions options;
  DirectionPullOptions& pull = options.pull;
  pull.threshold = settings.number("threshold", pull.threshold, 1e-9, 1e9);
  pull.base = settings.number("base", pull.base, 0.01, 100);
  pull.gain = settings.number("gain", pull.gain, 0, 1e6);
  pull.power = settings.number("power", pull.power, 0.1, 1000);
  return directionControl(options);
}

}  // namespace stipple
