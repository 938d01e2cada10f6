// Based on: Rota Bulo, Porzi, Kontschieder, Revising Densification in Gaussian Splatting, ECCV
// 2024: sections on error-based densification, growth control and opacity correction. Differs: a
// part of a splat too small for five per cent of a splat still multiplies, one per event; the
// publication leaves open which splats are split and when faint ones go: both as Kerbl et al. 2023.

#include "densify/strategies/revised.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/parts/opacity_correction.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

class ErrorPeaks final : public ControlPart {
 public:
  ErrorPeaks(double threshold, double small_share)
      : threshold_(static_cast<float>(threshold)), small_share_(small_share) {}

  const char* name() const override { return "error_peaks"; }
  ControlRoles owns() const override { return roles(ControlRole::kMultiplication); }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (moment.is_learning) request.structure_errors = true;
  }

  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (!moment.is_learning) return;
    const std::span<const float> errors = view.of(Statistic::kErrors);
    if (peaks_.empty()) peaks_.assign(errors.size(), 0.0f);
    if (peaks_.size() != errors.size()) {
      fail(ErrorCode::kInternal, "errors of " + std::to_string(peaks_.size()) +
                                     " splats are kept; the view is of " +
                                     std::to_string(errors.size()));
    }
    parallelFor(errors.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) peaks_[i] = std::max(peaks_[i], errors[i]);
    });
  }

  std::vector<Candidate> candidates(const ControlMoment& moment, const RawSplats& splats) override {
    peaks_.resize(splats.size(), 0.0f);
    const float small = logShareOfExtent(moment, small_share_);
    std::vector<Candidate> found;
    score_.resize(splats.size());
    for (uint32_t i = 0; i < splats.size(); ++i) {
      score_[i] = peaks_[i] / threshold_;
      if (score_[i] > 1) found.push_back({i, score_[i], largestLogScale(splats, i) > small});
    }
    return found;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    if (moment.is_event || edit.countAfter(count_before) != count_before) {
      peaks_.assign(edit.countAfter(count_before), 0.0f);
    }
    if (score_.size() == count_before) followEdit(edit, 1, 0.0f, score_);
  }

  /// Of the last event, in units of the threshold.
  std::vector<float> scores() const override { return score_; }

  void put(TensorTable& table) const override { table["peaks"] = {{peaks_.size()}, peaks_}; }
  void take(const TensorTable& table) override {
    std::vector<float> peaks = stateArray<float>(table, "peaks");
    for (const float peak : peaks) {
      if (peak >= 0 && std::isfinite(peak)) continue;
      fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(peak) +
                                   " among peaks; 0 and more is allowed");
    }
    peaks_ = std::move(peaks);
  }

 private:
  float threshold_;
  double small_share_;
  std::vector<float> peaks_;  ///< [N] greatest error of a view since the last event
  std::vector<float> score_;  ///< [N]
};

class GrowthShare final : public ControlPart {
 public:
  GrowthShare(double share, uint64_t interval)
      : share_(share), interval_(static_cast<double>(interval)) {}
  const char* name() const override { return "growth_share"; }
  ControlRoles owns() const override { return roles(ControlRole::kGrowth); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }

  uint64_t limit(const ControlMoment& moment, uint64_t count) override {
    // Events of a short fit stand for several published ones.
    const double published = static_cast<double>(FitMoment{}.iterations);
    const double events = static_cast<double>(moment.interval) * published /
                          (interval_ * static_cast<double>(moment.iterations));
    const double factor = std::pow(1 + share_, std::max(1.0, events));
    const double grown = std::floor(static_cast<double>(count) * std::min(factor, kMostGrowth));
    // A few splats must be able to become more.
    return std::max(count + 1, static_cast<uint64_t>(grown));
  }

 private:
  static constexpr double kMostGrowth = 1e6;  // beyond, no event has as many candidates

  double share_;
  double interval_;  ///< iterations of 30,000 between published events
};

class OpacityDecay final : public ControlPart {
 public:
  explicit OpacityDecay(double decay) : decay_(decay) {}

  const char* name() const override { return "opacity_decay"; }
  ControlRoles owns() const override { return roles(ControlRole::kOpacity); }

  void lowerOpacities(const ControlMoment& moment, const RawSplats& splats,
                      SplatEdit& edit) override {
    if (!moment.is_event) return;
    RowWrite write;
    write.array = RawArray::kLogits;
    write.rows.resize(splats.size());
    write.values = splats.logits;
    for (uint32_t i = 0; i < splats.size(); ++i) write.rows[i] = i;
    // What the same edit has written before is lowered, not undone.
    for (const RowWrite& before : edit.writes) {
      if (before.array != RawArray::kLogits) continue;
      for (size_t k = 0; k < before.rows.size(); ++k) {
        write.values[before.rows[k]] = before.values[k];
      }
    }
    for (float& logit : write.values) logit = lowered(logit);
    for (float& logit : edit.append.logits) logit = lowered(logit);
    edit.writes.push_back(std::move(write));
  }

 private:
  /// In double: logits of opacities near 1 keep their digits.
  float lowered(float logit) const {
    const double x = static_cast<double>(logit);
    const double small = std::exp(-std::abs(x));
    const double opacity = (x >= 0 ? 1.0 : small) / (1 + small);
    const double rest = (x >= 0 ? small : 1.0) / (1 + small);  // 1 - opacity
    const double left = opacity - decay_;
    if (left <= static_cast<double>(kLeastRawOpacity)) return rawOpacity(kLeastRawOpacity);
    return static_cast<float>(std::log(left) - std::log(rest + decay_));
  }

  double decay_;
};

class ResidualLight final : public ControlPart {
 public:
  explicit ResidualLight(double weight) : weight_(weight) {}
  const char* name() const override { return "residual_light"; }
  ControlRoles owns() const override { return roles(ControlRole::kRegularisation); }
  double transmittanceWeight(const ControlMoment&) const override { return weight_; }

 private:
  double weight_;
};

}  // namespace

std::unique_ptr<ControlPart> makeErrorPeaks(double threshold, double small_share) {
  return std::make_unique<ErrorPeaks>(threshold, small_share);
}

std::unique_ptr<ControlPart> makeGrowthShare(double share, uint64_t interval) {
  return std::make_unique<GrowthShare>(share, interval);
}

std::unique_ptr<ControlPart> makeOpacityDecay(double decay) {
  return std::make_unique<OpacityDecay>(decay);
}

ControlAssembly revisedControl(StrategySettings& settings) {
  RevisedOptions options;
  options.threshold = settings.number("threshold", options.threshold, 1e-9, 1e9);
  options.growth = settings.number("growth", options.growth, 0, 10);
  options.decay = settings.number("decay", options.decay, 0, 1);
  options.transmittance = settings.number("transmittance", options.transmittance, 0, 100);
  return revisedControl(options);
}

ControlAssembly revisedControl(const RevisedOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeErrorPeaks(options.threshold, options.small_share));
  addPart(assembly, makeCloneOrSplit(options.children));
  addPart(assembly, makeOpacityCorrection(true));
  addPart(assembly, makeGrowthShare(options.growth, options.schedule.interval));
  addPart(assembly, makeFaintRemoval(options.removal));
  addPart(assembly, makeOpacityDecay(options.decay));
  addPart(assembly, std::make_unique<ResidualLight>(options.transmittance));
  return assembly;
}

}  // namespace stipple
