// Based on: Mallick, Goel, Kerbl, Steinberger, Vicente Carrasco, De La Torre, Taming 3DGS:
// High-Quality Radiance Fields with Limited Resources, SIGGRAPH Asia 2024, section 4, with the
// constants of its published program. Differs: medians and spans of nothing count as 1 or 0 instead
// of failing; the views are those of the iterations before an event, whose backward pass is taken
// anyway, and more are drawn only where those are too few; the curve ends at the last event, not
// one interval later; edges are those of edge_weights.h; children of the same event are not
// removed; the program's opacities above 1, after events are over, have no place in splat files and
// are left out.

#include "densify/strategies/taming.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/quantities/edge_weights.h"
#include "densify/quantities/gradient_window.h"
#include "densify/state_arrays.h"
#include "densify/strategies.h"
#include "math/covariance.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 12;
constexpr double kScale = 50;        ///< of a view's score
constexpr double kScreenBlur = 0.3;  ///< pixels squared, added to variances in the picture
constexpr double kDeviations = 3;    ///< of a radius

/// Scores of the last event, for who multiplies and who goes.
struct Scores {
  std::vector<double> of;  ///< [N]
};

/// What is said of a splat, as it counts in the score.
struct Column {
  double weight;
  std::function<double(size_t)> value;
};

/// Median of what is said of visible splats, of values above 0; 1 where none is.
double medianOf(const Column& column, std::span<const uint8_t> visible) {
  std::vector<double> positive;
  positive.reserve(visible.size());
  for (size_t i = 0; i < visible.size(); ++i) {
    const double value = visible[i] ? column.value(i) : 0.0;
    if (value > 0) positive.push_back(value);
  }
  if (positive.empty()) return 1;
  const auto middle = positive.begin() + static_cast<ptrdiff_t>((positive.size() - 1) / 2);
  std::nth_element(positive.begin(), middle, positive.end());
  return *middle;
}

/// [H,W] how much a pixel matters: its error over the span of errors, and its edge.
std::vector<float> pixelWeights(const ViewErrors& seen, double error_weight, double edge_weight) {
  std::vector<float> errors(seen.target.size() / 3);
  for (size_t i = 0; i < errors.size(); ++i) {
    float sum = 0;
    for (size_t c = 0; c < 3; ++c) {
      sum += std::abs(seen.picture[i * 4 + c] - seen.target[i * 3 + c]);
    }
    errors[i] = sum / 3;
  }
  const auto [least, most] = std::minmax_element(errors.begin(), errors.end());
  const float low = *least, span = *most - *least;
  const std::vector<float> edges = edgeWeights(seen.width, seen.height, seen.target);
  for (size_t i = 0; i < errors.size(); ++i) {
    const float error = span > 0 ? (errors[i] - low) / span : 0.0f;
    errors[i] =
        static_cast<float>(error_weight) * error + static_cast<float>(edge_weight) * edges[i];
  }
  return errors;
}

/// Depth of a splat's centre, and how far it reaches in the picture, pixels; 0 behind the camera.
struct Projection {
  double depth = 0, radius = 0;

  Projection() = default;
  Projection(const Camera& camera, const DrawnSplats& cloud, size_t i) {
    const Mat3d turn = camera.world_to_camera.topLeftCorner<3, 3>();
    const float* p = &cloud.positions[i * 3];
    const Vec3d seen = turn * Vec3d(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                    static_cast<double>(p[2])) +
                       camera.world_to_camera.topRightCorner<3, 1>();
    if (!(seen.z() > camera.near_plane)) return;
    depth = seen.z();
    const bool is_perspective = camera.model == CameraModel::kPerspective;
    const double z = is_perspective ? seen.z() : 1.0;
    // Rows of the derivative of a pixel by a place in front of the camera.
    Vec3d by_x(camera.fx / z, 0, 0), by_y(0, camera.fy / z, 0);
    if (is_perspective) {
      by_x.z() = -camera.fx * seen.x() / (z * z);
      by_y.z() = -camera.fy * seen.y() / (z * z);
    }
    const Mat3d axes = turn * scaledAxes<double>(&cloud.rotations[i * 4], &cloud.scales[i * 3]);
    const Vec3d across = axes.transpose() * by_x, along = axes.transpose() * by_y;
    const double xx = across.dot(across) + kScreenBlur, yy = along.dot(along) + kScreenBlur;
    const double half = 0.5 * (xx + yy), xy = across.dot(along);
    radius = std::ceil(kDeviations * std::sqrt(half + std::hypot(0.5 * (xx - yy), xy)));
  }
};

/// Which splats matter, by a look at some views. Owns kScore.
class TamingScore final : public ControlPart {
 public:
  TamingScore(const TamingOptions& options, std::shared_ptr<Scores> scores)
      : options_(options), scores_(std::move(scores)), pulls_(Statistic::kScreenGradients) {}

  const char* name() const override { return "taming_score"; }
  ControlRoles owns() const override { return roles(ControlRole::kScore); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }
  bool drawsByKind() const override { return true; }

  void request(const ControlMoment& moment, StatisticRequest& request) const override {
    if (moment.is_learning) request.screen_gradients = true;
    if (moment.view && looks(moment, moment.view->index)) ask(request);
  }
  void observe(const ControlMoment& moment, const ViewStatistics& view) override {
    if (!moment.is_learning) return;
    pulls_.add(view);
    const bool is_whole = !view.of(Statistic::kCoveredErrors).empty();
    if (is_whole && looks(moment, view.view)) addView(view);
  }

  bool wantsSweep(const ControlMoment& moment) const override { return moment.is_event; }

  void sweep(const ControlMoment& moment, ViewEvaluator& views) override {
    const size_t count = views.splats().size();
    if (scores_->of.size() != count) begin(count);
    std::vector<uint32_t> others;
    for (uint32_t view = 0; view < views.viewCount(); ++view) {
      if (!hasLookedAt(view)) others.push_back(view);
    }
    const std::vector<double> alike(others.size(), 1.0);
    const size_t wanted =
        options_.view_count - std::min<uint64_t>(options_.view_count, looked_at_.size());
    StatisticRequest request;
    ask(request);
    for (const uint32_t view :
         drawWithoutReplacement(moment, RandomUse::kViewOrder, others, alike, wanted)) {
      addView(views.evaluate(view, request));
    }
  }

  std::vector<double> score(const ControlMoment&, const RawSplats& splats,
                            std::span<const Candidate> candidates) override {
    const bool is_known = scores_->of.size() == splats.size();
    std::vector<double> values;
    for (const Candidate& one : candidates) values.push_back(is_known ? scores_->of[one.row] : 1.0);
    // Where no view tells them apart, all are alike.
    const bool is_empty =
        std::none_of(values.begin(), values.end(), [](double value) { return value > 0; });
    if (is_empty) std::fill(values.begin(), values.end(), 1.0);
    return values;
  }

  void edited(const ControlMoment& moment, const SplatEdit& edit, size_t count_before) override {
    pulls_.edited(moment, edit, count_before);
    if (moment.is_event) {
      constexpr double kMost = 1e30;  // of splats that are larger than the scene by far
      seen_.resize(scores_->of.size());
      std::transform(scores_->of.begin(), scores_->of.end(), seen_.begin(),
                     [kMost](double score) { return static_cast<float>(std::min(score, kMost)); });
    }
    if (seen_.size() == count_before) followEdit(edit, 1, 0.0f, seen_);
    if (moment.is_event || edit.keep || edit.append.size() > 0) begin(0);
  }

  std::vector<float> scores() const override { return seen_; }
  void put(TensorTable& table) const override {
    pulls_.put(table);
    table["scores"] = {{scores_->of.size()}, scores_->of};
    table["views"] = {{looked_at_.size()}, looked_at_};
  }
  void take(const TensorTable& table) override {
    GradientWindow pulls = pulls_;
    pulls.take(table);
    std::vector<double> scores = stateSums<double>(table, "scores");
    looked_at_ = stateArray<uint64_t>(table, "views");
    scores_->of = std::move(scores);
    pulls_ = std::move(pulls);
  }

 private:
  void begin(size_t count) {
    scores_->of.assign(count, 0.0);
    looked_at_.clear();
  }
  bool hasLookedAt(uint64_t view) const {
    return std::find(looked_at_.begin(), looked_at_.end(), view) != looked_at_.end();
  }
  /// Whether this iteration's view is one of the last before an event.
  bool looks(const ControlMoment& moment, uint64_t view) const {
    return moment.until_event < options_.view_count && looked_at_.size() < options_.view_count &&
           !hasLookedAt(view);
  }

  void ask(StatisticRequest& request) const {
    request.covered = request.blending_weights = request.drawn_splats = true;
    request.errors_of = [error_weight = options_.error_weight,
                         edge_weight = options_.edge_weight](const ViewErrors& seen) {
      return pixelWeights(seen, error_weight, edge_weight);
    };
  }

  void addView(const ViewStatistics& seen) {
    const DrawnSplats& cloud = seen.splats;
    const Camera& camera = *seen.camera;
    const size_t count = seen.visible.size();
    if (scores_->of.size() != count) begin(count);
    if (pulls_.size() != count) pulls_.reset(count);
    looked_at_.push_back(seen.view);
    std::vector<Projection> projected(count);
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (seen.visible[i]) projected[i] = Projection(camera, cloud, i);
      }
    });
    const auto statistic = [&](Statistic which) {
      return [told = seen.of(which)](size_t i) { return static_cast<double>(told[i]); };
    };
    const TamingWeights& w = options_.weights;
    const Column columns[] = {
        {w.pull, [&](size_t i) { return static_cast<double>(pulls_.average(i)); }},
        {w.opacity, [&](size_t i) { return static_cast<double>(cloud.opacities[i]); }},
        {w.depth, [&](size_t i) { return projected[i].depth; }},
        {w.radius, [&](size_t i) { return projected[i].radius; }},
        {w.volume,
         [&](size_t i) {
           const float* s = &cloud.scales[i * 3];
           return static_cast<double>(s[0]) * static_cast<double>(s[1]) * static_cast<double>(s[2]);
         }},
        {w.distances, statistic(Statistic::kCoveredDistances)},
        {w.errors, statistic(Statistic::kCoveredErrors)},
        {w.pixels, statistic(Statistic::kCoveredPixels)},
        {w.blending, statistic(Statistic::kBlendingWeights)}};
    double medians[std::size(columns)];
    parallelFor(std::size(columns), 1, [&](size_t begin, size_t end) {
      for (size_t c = begin; c < end; ++c) medians[c] = medianOf(columns[c], seen.visible);
    });
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!seen.visible[i]) continue;
        double total = 0;
        for (size_t c = 0; c < std::size(columns); ++c) {
          total += columns[c].weight * (columns[c].value(i) / medians[c]);
        }
        scores_->of[i] += kScale * seen.loss * total;
      }
    });
  }

  TamingOptions options_;
  std::shared_ptr<Scores> scores_;
  std::vector<uint64_t> looked_at_;  ///< views in the scores
  GradientWindow pulls_;
  std::vector<float> seen_;  ///< [N] of the last event
};

class TamingGrowth final : public ControlPart {
 public:
  explicit TamingGrowth(double budget) : budget_(budget) {}
  const char* name() const override { return "taming_growth"; }
  ControlRoles owns() const override { return roles(ControlRole::kGrowth); }
  ControlRoles needs() const override { return roles(ControlRole::kMultiplication); }

  uint64_t limit(const ControlMoment& moment, uint64_t count) override {
    if (start_ == 0) start_ = count;
    const uint64_t end = moment.max_splats > 0
                             ? moment.max_splats
                             : static_cast<uint64_t>(budget_ * static_cast<double>(start_));
    const double done = moment.event_count > 0 ? static_cast<double>(moment.event + 1) /
                                                     static_cast<double>(moment.event_count)
                                               : 1.0;
    return tamingCount(start_, end, done);
  }

  void put(TensorTable& table) const override {
    table["start"] = {{1}, std::vector<uint64_t>{start_}};
  }
  void take(const TensorTable& table) override {
    const std::vector<uint64_t> start = stateArray<uint64_t>(table, "start");
    if (start.size() != 1) {
      fail(ErrorCode::kFormat, "the strategy's state has " + std::to_string(start.size()) +
                                   " numbers in start; 1 is needed");
    }
    start_ = start[0];
  }

 private:
  double budget_;
  uint64_t start_ = 0;  ///< splats at the first event; 0: it has not been
};

/// A share of what another removal names goes, those that matter least the likeliest.
class SharedRemoval final : public ControlPart {
 public:
  SharedRemoval(const TamingOptions& options, std::shared_ptr<const Scores> scores)
      : options_(options), scores_(std::move(scores)), named_(makeFaintRemoval(options.removal)) {}

  const char* name() const override { return "taming_removal"; }
  ControlRoles owns() const override { return roles(ControlRole::kRemoval); }

  bool removesAt(const ControlMoment& moment) const override {
    return named_->removesAt(moment) && !moment.isAfter(options_.removal_until);
  }

  void remove(const ControlMoment& moment, const RawSplats& splats, const RawSplats&,
              std::span<uint8_t> goes, std::span<uint8_t>) override {
    std::vector<uint8_t> is_named(splats.size(), 0);
    named_->remove(moment, splats, rowsOf(splats, {}), is_named, {});
    std::vector<uint32_t> rows;
    std::vector<double> weights;
    const bool is_known = scores_->of.size() == splats.size();
    for (uint32_t i = 0; i < splats.size(); ++i) {
      if (!is_named[i]) continue;
      rows.push_back(i);
      weights.push_back(1 / (kLeastScore + (is_known ? scores_->of[i] : 0.0)));
    }
    const double most = options_.removed_share * static_cast<double>(rows.size());
    for (const uint32_t row : drawWithoutReplacement(moment, RandomUse::kRemovalChoice, rows,
                                                     weights, static_cast<size_t>(most))) {
      goes[row] = 1;
    }
  }

 private:
  static constexpr double kLeastScore = 1e-6;

  TamingOptions options_;
  std::shared_ptr<const Scores> scores_;
  std::unique_ptr<ControlPart> named_;
};

class OpacityRate final : public ControlPart {
 public:
  explicit OpacityRate(double rate) : rate_(rate) {}
  const char* name() const override { return "opacity_rate"; }
  ControlRoles owns() const override { return 0; }
  void adjustRates(LearningRates& rates) const override { rates.logit = rate_; }

 private:
  double rate_;
};

}  // namespace

uint64_t tamingCount(uint64_t start, uint64_t end, double done) {
  const double left = 1 - std::clamp(done, 0.0, 1.0);
  const double from = static_cast<double>(start), to = static_cast<double>(end);
  return static_cast<uint64_t>(std::floor(to - (to - from) * left * left));
}

ControlAssembly tamingControl(StrategySettings& settings) {
  TamingOptions options;
  const double threshold = settings.number("threshold", options.pull.copy_threshold, 1e-9, 1e9);
  options.pull.copy_threshold = options.pull.split_threshold = threshold;
  options.budget = settings.number("budget", options.budget, 1, 1000);
  options.view_count = settings.count("views", options.view_count);
  return tamingControl(options);
}

ControlAssembly tamingControl(const TamingOptions& options) {
  const auto scores = std::make_shared<Scores>();
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeScreenPull(options.pull));
  addPart(assembly, std::make_unique<TamingScore>(options, scores));
  addPart(assembly, makeCloneOrSplit(options.children));
  addPart(assembly, std::make_unique<TamingGrowth>(options.budget));
  addPart(assembly, std::make_unique<SharedRemoval>(options, scores));
  addPart(assembly, makeOpacityReset(options.reset));
  addPart(assembly, std::make_unique<OpacityRate>(options.opacity_rate));
  return assembly;
}

}  // namespace stipple
