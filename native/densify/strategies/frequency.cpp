// Based on: Zeng, Wang, Ju, Guan, Frequency-Aware Density Control via Reparameterization for
// High-Quality Rendering of 3D Gaussian Splatting, AAAI 2025, and its program (schedule, constants,
// confidence). Differs: splats are compared with their own covariances (view_confidence.h);
// gradients that are all 0 remove nothing by chance; there is a hard cap, under which the splats
// with the highest gradients multiply; gradients of pictures that are not square count per half of
// the geometric mean of their sides.

#include "densify/strategies/frequency.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/random.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/density_scale.h"
#include "densify/published_unit.h"
#include "densify/quantities/view_confidence.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"

namespace stipple {

namespace {

constexpr double kChildShrink = 1.6;
constexpr double kLeastRadius = 1e-7;  ///< published units: twins have no distance

class FrequencyControl final : public ControlPart {
 public:
  explicit FrequencyControl(const FrequencyOptions& options) : options_(options) {}

  const char* name() const override { return "density_scale"; }
  ControlRoles owns() const override {
    return roles(ControlRole::kMultiplication, ControlRole::kScore, ControlRole::kChildren,
                 ControlRole::kChildOpacity, ControlRole::kRemoval, ControlRole::kRecovery,
                 ControlRole::kParameterisation);
  }

  void prepare(RawSplats& splats, uint64_t) const override {
    const float change = static_cast<float>(std::log(options_.start_scale));
    for (float& log_scale : splats.log_scales) log_scale += change;
  }
  std::vector<ExtraParameter> parameters() const override { return DensityScale::parameters(); }
  std::vector<std::vector<float>> initialExtras(const RawSplats& splats) const override {
    return DensityScale::initialExtras(splats);
  }
  const Parameterisation* parameterisation() const override { return &scale_; }

  bool removesAt(const ControlMoment&) const override { return false; }
  bool wantsSweep(const ControlMoment& moment) const override { return moment.is_event; }

  void sweep(const ControlMoment& moment, ViewEvaluator& views) override {
    const SplatCloud& splats = views.splats();
    std::vector<double> sums(splats.size(), 0.0), weights(splats.size(), 0.0);
    BestViews best(removesNow(moment) ? splats.size() : 0);
    StatisticRequest request;
    request.blending_weights = true;
    request.absolute_screen_gradients = true;  // and their lengths
    request.drawn_splats = true;
    for (size_t v = 0; v < views.viewCount(); ++v) {
      const ViewStatistics& view = views.evaluate(v, request);
      addGradients(view, sums, weights);
      if (best.size() > 0) best.add(view);
    }
    gradients_.resize(splats.size());
    for (size_t i = 0; i < gradients_.size(); ++i) {
      gradients_[i] = weights[i] > 0 ? sums[i] / weights[i] : 0.0;
    }
    confidences_ = best.confidences(views);
  }

  void multiply(const ControlMoment& moment, const SplatStore& store, uint64_t room,
                SplatEdit& edit) override {
    const RawSplats& splats = store.splats();
    const bool has_looked = gradients_.size() == splats.size();
    std::vector<uint32_t> stay = staying(splats);
    std::vector<double> gradients;
    for (const uint32_t row : stay) gradients.push_back(has_looked ? gradients_[row] : 0.0);
    const DynamicThreshold threshold = dynamicThreshold(gradients, options_);
    showScore(splats.size(), threshold.value);
    edit.append = childrenOf(moment, splats, chosen(stay, gradients, threshold.value, room));
    if (threshold.is_least) thinOut(moment, splats.size(), stay, edit.append);
    resetRadii(moment, splats, stay, edit);
    if (stay.size() < splats.size()) edit.keep = std::move(stay);
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    gradients_.clear();
    confidences_.clear();
    if (is_new_.size() != count_before) is_new_.assign(count_before, 0.0f);
    if (moment.is_event) std::fill(is_new_.begin(), is_new_.end(), 0.0f);
    followEdit(edit, 1, 1.0f, is_new_);
    if (score_.size() == count_before) followEdit(edit, 1, 0.0f, score_);
  }

  /// Gradients of the last event, in units of the threshold.
  std::vector<float> scores() const override { return score_; }

  void put(TensorTable& table) const override { table["is_new"] = {{is_new_.size()}, is_new_}; }
  void take(const TensorTable& table) override { is_new_ = stateArray<float>(table, "is_new"); }

 private:
  /// Every second event.
  static bool removesNow(const ControlMoment& moment) { return moment.event % 2 == 1; }

  static void addGradients(const ViewStatistics& view, std::vector<double>& sums,
                           std::vector<double>& weights) {
    const std::span<const float> seen = view.of(Statistic::kBlendingWeights);
    const std::span<const float> norms = view.of(Statistic::kScreenGradientNorms);
    const double half =
        0.5 * std::sqrt(static_cast<double>(view.width) * static_cast<double>(view.height));
    for (size_t i = 0; i < sums.size(); ++i) {
      if (!view.visible[i]) continue;
      const double weight = static_cast<double>(seen[i]);
      sums[i] += weight * half * static_cast<double>(norms[i]);
      weights[i] += weight;
    }
  }

  std::vector<uint32_t> staying(const RawSplats& splats) const {
    std::vector<uint32_t> rows;
    const bool removes = confidences_.size() == splats.size();
    for (uint32_t i = 0; i < splats.size(); ++i) {
      const bool is_new = i < is_new_.size() && is_new_[i] > 0;
      const bool goes =
          removes && !is_new && static_cast<double>(confidences_[i]) < options_.least_confidence;
      if (!goes) rows.push_back(i);
    }
    return rows;
  }

  /// In: gradients of `stay`. Two children of each beside it are within the room.
  static std::vector<uint32_t> chosen(const std::vector<uint32_t>& stay,
                                      const std::vector<double>& gradients, double threshold,
                                      uint64_t room) {
    std::vector<size_t> order;
    for (size_t k = 0; k < stay.size(); ++k) {
      if (gradients[k] >= threshold) order.push_back(k);
    }
    const uint64_t most = room > stay.size() ? (room - stay.size()) / 2 : 0;
    if (order.size() > most) {
      std::stable_sort(order.begin(), order.end(),
                       [&](size_t a, size_t b) { return gradients[a] > gradients[b]; });
      order.resize(static_cast<size_t>(most));
      std::sort(order.begin(), order.end());
    }
    std::vector<uint32_t> rows;
    for (const size_t k : order) rows.push_back(stay[k]);
    return rows;
  }

  static RawSplats childrenOf(const ControlMoment& moment, const RawSplats& splats,
                              const std::vector<uint32_t>& parents) {
    std::vector<uint32_t> twice;
    for (const uint32_t row : parents) twice.insert(twice.end(), 2, row);
    RawSplats children = rowsOf(splats, twice);
    for (size_t k = 0; k < twice.size(); ++k) {
      writeLogScales(children, k);
      placeInDistribution(moment, twice[k], k % 2, k, children);
      children.extras[0][k] -= static_cast<float>(std::log(kChildShrink));
      writeLogScales(children, k);
    }
    return children;
  }

  static void writeLogScales(RawSplats& splats, size_t row) {
    for (size_t axis = 0; axis < 3; ++axis) {
      splats.log_scales[row * 3 + axis] = DensityScale::logScale(splats, row, axis);
    }
  }

  /// A share of all, children too, goes by chance.
  void thinOut(const ControlMoment& moment, size_t count, std::vector<uint32_t>& stay,
               RawSplats& append) const {
    std::vector<uint32_t> all = stay;
    for (size_t k = 0; k < append.size(); ++k) all.push_back(static_cast<uint32_t>(count + k));
    const size_t gone =
        static_cast<size_t>(options_.random_removal * static_cast<double>(all.size()));
    const std::vector<uint32_t> drawn = drawWithoutReplacement(
        moment, RandomUse::kRemovalChoice, all, std::vector<double>(all.size(), 1.0), gone);
    std::vector<uint32_t> left, children;
    std::set_difference(all.begin(), all.end(), drawn.begin(), drawn.end(),
                        std::back_inserter(left));
    stay.clear();
    for (const uint32_t row : left) {
      row < count ? stay.push_back(row) : children.push_back(row - static_cast<uint32_t>(count));
    }
    append = rowsOf(append, children);
  }

  void resetRadii(const ControlMoment& moment, const RawSplats& splats,
                  const std::vector<uint32_t>& stay, SplatEdit& edit) const {
    std::vector<float> positions;
    for (const uint32_t row : stay) {
      positions.insert(positions.end(), &splats.positions[row * 3], &splats.positions[row * 3] + 3);
    }
    positions.insert(positions.end(), edit.append.positions.begin(), edit.append.positions.end());
    const std::vector<double> radii = localRadii(positions, options_.radius);
    if (radii.empty()) return;  // a splat that is alone keeps its own
    const double least = kLeastRadius * publishedUnit(moment);
    const auto log_radius = [&](size_t k) {
      return static_cast<float>(std::log(std::max(radii[k], least)));
    };
    RawSplats now = rowsOf(splats, stay);
    for (size_t k = 0; k < stay.size(); ++k) {
      now.extras[0][k] = log_radius(k);
      writeLogScales(now, k);
    }
    for (size_t k = 0; k < edit.append.size(); ++k) {
      edit.append.extras[0][k] = log_radius(stay.size() + k);
      writeLogScales(edit.append, k);
    }
    if (stay.empty()) return;
    edit.writes.push_back({extraArray(0), stay, std::move(now.extras[0]), true});
    edit.writes.push_back({RawArray::kLogScales, stay, std::move(now.log_scales), true});
  }

  void showScore(size_t count, double threshold) {
    score_.assign(count, 0.0f);
    for (size_t i = 0; i < std::min(count, gradients_.size()); ++i) {
      score_[i] = static_cast<float>(gradients_[i] / threshold);
    }
  }

  FrequencyOptions options_;
  DensityScale scale_;
  std::vector<double> gradients_;   ///< [N] of the event under way
  std::vector<float> confidences_;  ///< [N] of the event under way, where it removes
  std::vector<float> is_new_;       ///< [N] 1 for splats of the last event
  std::vector<float> score_;        ///< [N]
};

}  // namespace

DynamicThreshold dynamicThreshold(std::span<const double> gradients,
                                  const FrequencyOptions& options) {
  constexpr size_t kBins = 1000;
  if (gradients.empty()) return {options.least_threshold, false};
  const double mean = std::accumulate(gradients.begin(), gradients.end(), 0.0) /
                      static_cast<double>(gradients.size());
  const double low = *std::min_element(gradients.begin(), gradients.end());
  const double high = 3 * mean;
  if (!(high > low)) return {options.least_threshold, false};
  std::vector<size_t> bins(kBins, 0);
  size_t total = 0;
  for (const double gradient : gradients) {
    if (gradient > high) continue;
    const double place = (gradient - low) / (high - low) * static_cast<double>(kBins);
    ++bins[std::min(static_cast<size_t>(place), kBins - 1)];
    ++total;
  }
  size_t bin = 0, sum = bins[0];
  while (static_cast<double>(sum) < options.quantile * static_cast<double>(total)) {
    sum += bins[++bin];
  }
  const double value = low + static_cast<double>(bin) / static_cast<double>(kBins) * (high - low);
  if (value < options.least_threshold) return {options.least_threshold, true};
  return {value, false};
}

ControlAssembly frequencyControl(const FrequencyOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, std::make_unique<FrequencyControl>(options));
  addPart(assembly, makeOpacityReset(options.reset));
  return assembly;
}

ControlAssembly frequencyControl(StrategySettings& settings) {
  FrequencyOptions options;
  options.least_threshold = settings.number("threshold", options.least_threshold, 1e-12, 1e9);
  options.quantile = settings.number("quantile", options.quantile, 0, 1);
  options.least_confidence = settings.number("confidence", options.least_confidence, 0, 1);
  options.random_removal = settings.number("random_removal", options.random_removal, 0, 1);
  return frequencyControl(options);
}

}  // namespace stipple
