// The strategy "taming" in a fit, through the trainer: what a test plants into views by hand says
// nothing about what a fit tells a strategy.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "densify/strategies.h"
#include "fit_scene.h"
#include "math/covariance.h"
#include "train/loop/explicit_model.h"
#include "train/loop/trainer.h"

namespace stipple {
namespace {

using namespace stipple::testing;

constexpr size_t kViews = 10;  // as many as the strategy looks at before an event
constexpr size_t kSplats = 40;
constexpr uint64_t kEvent = 100;  // of a fit of 3000

/// Sums that a splat's score is made of, from the views of the last iterations before an event.
struct ByHand {
  std::vector<double> pull_sums, pull_counts, scores;
};

/// Median of the values above 0 of visible splats; 1 where there are none.
double medianOf(const std::vector<double>& values, std::span<const uint8_t> visible) {
  std::vector<double> positive;
  for (size_t i = 0; i < values.size(); ++i) {
    if (visible[i] && values[i] > 0) positive.push_back(values[i]);
  }
  if (positive.empty()) return 1;
  std::sort(positive.begin(), positive.end());
  return positive[(positive.size() - 1) / 2];
}

/// Depth of a splat and radius of its image, by Taming 3DGS' program: three standard deviations of
/// the longer axis of the projected covariance, blurred by 0.3 px^2, rounded up.
std::pair<double, double> projected(const Camera& camera, const DrawnSplats& splats, size_t i) {
  const Mat3d rotation = camera.world_to_camera.topLeftCorner<3, 3>();
  const float* p = &splats.positions[i * 3];
  const Vec3d seen =
      rotation * Vec3d(p[0], p[1], p[2]) + camera.world_to_camera.topRightCorner<3, 1>();
  Eigen::Matrix<double, 2, 3> jacobian;
  jacobian << camera.fx / seen.z(), 0, -camera.fx * seen.x() / (seen.z() * seen.z()),  //
      0, camera.fy / seen.z(), -camera.fy * seen.y() / (seen.z() * seen.z());
  const Mat3d axes = rotation * scaledAxes<double>(&splats.rotations[i * 4], &splats.scales[i * 3]);
  const Eigen::Matrix2d covariance =
      jacobian * axes * axes.transpose() * jacobian.transpose() + 0.3 * Eigen::Matrix2d::Identity();
  const double half_trace = 0.5 * covariance.trace();
  const double longer =
      half_trace + std::sqrt(std::max(0.0, half_trace * half_trace - covariance.determinant()));
  return {seen.z(), std::ceil(3 * std::sqrt(longer))};
}

/// Passes everything on to a strategy, and adds up what it should make of it, with the losses that
/// the fit's own records tell.
class Witness final : public Strategy {
 public:
  Witness(ByHand& by_hand, std::map<uint64_t, std::vector<double>>& sums, bool plants_zero)
      : strategy_(makeStrategy("taming")),
        by_hand_(by_hand),
        sums_(sums),
        plants_zero_(plants_zero) {}

  const char* name() const override { return "witness"; }
  void adjustRates(LearningRates& rates) const override { strategy_->adjustRates(rates); }
  StatisticRequest requests(const FitMoment& moment) const override {
    return strategy_->requests(moment);
  }
  bool stepGate(const FitMoment& moment) const override { return strategy_->stepGate(moment); }
  bool wantsSweep(const FitMoment& moment) const override { return strategy_->wantsSweep(moment); }
  void sweep(const FitMoment& moment, ViewEvaluator& views) override {
    strategy_->sweep(moment, views);
  }

  void observe(const FitMoment& moment, const ViewStatistics& view) override {
    if (moment.iteration <= kEvent) addByHand(moment.iteration, view);
    ViewStatistics told = view;
    if (plants_zero_) told.loss = 0;
    strategy_->observe(moment, told);
  }
  std::optional<SplatEdit> edit(const FitMoment& moment, const SplatStore& store) override {
    auto edit = strategy_->edit(moment, store);
    if (moment.iteration == kEvent) {
      const SplatQuantities seen = strategy_->seen(kSplats);
      by_hand_.scores.assign(seen.score.begin(), seen.score.end());
    }
    return edit;
  }

 private:
  /// The sum of a view without its loss, keyed by the iteration.
  void addByHand(uint64_t iteration, const ViewStatistics& view) {
    by_hand_.pull_sums.resize(kSplats, 0.0);
    by_hand_.pull_counts.resize(kSplats, 0.0);
    const auto pulls = view.of(Statistic::kScreenGradients);
    std::vector<std::vector<double>> columns(9, std::vector<double>(kSplats, 0.0));
    for (size_t i = 0; i < kSplats; ++i) {
      if (!view.visible[i]) continue;
      by_hand_.pull_sums[i] +=
          std::hypot(0.5 * view.width * static_cast<double>(pulls[i * 2]),
                     0.5 * view.height * static_cast<double>(pulls[i * 2 + 1]));
      by_hand_.pull_counts[i] += 1;
    }
    const auto covered = view.of(Statistic::kCoveredPixels);
    if (covered.empty()) return;
    const auto stored = [](std::span<const float> values, size_t i) {
      return static_cast<double>(values[i]);
    };
    for (size_t i = 0; i < kSplats; ++i) {
      if (!view.visible[i]) continue;
      const auto [depth, radius] = projected(*view.camera, view.splats, i);
      const float* s = &view.splats.scales[i * 3];
      columns[0][i] = by_hand_.pull_sums[i] / by_hand_.pull_counts[i];
      columns[1][i] = stored(view.splats.opacities, i);
      columns[2][i] = depth;
      columns[3][i] = radius;
      columns[4][i] =
          static_cast<double>(s[0]) * static_cast<double>(s[1]) * static_cast<double>(s[2]);
      columns[5][i] = stored(view.of(Statistic::kCoveredDistances), i);
      columns[6][i] = stored(view.of(Statistic::kCoveredErrors), i);
      columns[7][i] = stored(covered, i);
      columns[8][i] = stored(view.of(Statistic::kBlendingWeights), i);
    }
    constexpr double kWeights[9] = {25, 100, 5, 10, 25, 50, 10, 0.1, 50};
    std::vector<double>& sum = sums_[iteration];
    sum.assign(kSplats, 0.0);
    for (size_t c = 0; c < columns.size(); ++c) {
      const double median = medianOf(columns[c], view.visible);
      for (size_t i = 0; i < kSplats; ++i) {
        if (view.visible[i]) sum[i] += kWeights[c] * columns[c][i] / median;
      }
    }
  }

  std::unique_ptr<Strategy> strategy_;
  ByHand& by_hand_;
  std::map<uint64_t, std::vector<double>>& sums_;
  bool plants_zero_;
};

/// Stops a fit after an iteration.
class StopsAfter final : public FitObserver {
 public:
  explicit StopsAfter(uint64_t iteration) : last_(iteration) {}
  void figures(const FitFigures& figures) override {
    if (figures.iteration == last_) progress.cancel();
  }
  Progress progress;

 private:
  uint64_t last_;
};

struct Outcome {
  std::vector<double> told;      ///< [N] scores of the strategy
  std::vector<double> expected;  ///< [N] by hand
};

Outcome scoresOfAFit(bool plants_zero) {
  const SplatCloud truth = ballOfSplats(kSplats, 1);
  const auto views = viewsOf(truth, camerasAround(kViews, 48));
  SplatCloud start = truth;  // as many splats as there may be: an event changes none
  for (size_t i = 0; i < start.sh.size(); ++i) start.sh[i] *= 0.3f;
  for (float& scale : start.scales) scale *= 1.3f;
  ByHand by_hand;
  std::map<uint64_t, std::vector<double>> sums;
  ExplicitModelOptions model;
  model.sh_degree = 0;
  model.max_splats = kSplats;
  TrainerOptions options;
  options.iterations = 3000;
  options.seed = 4;
  Trainer trainer(*cpuBackends(), views, {allViews(*views), {}},
                  makeExplicitModel(*cpuBackends(), start,
                                    std::make_unique<Witness>(by_hand, sums, plants_zero), model),
                  options);
  StopsAfter observer(kEvent);
  trainer.run(observer, &observer.progress);
  Outcome outcome{by_hand.scores, std::vector<double>(kSplats, 0.0)};
  EXPECT_EQ(sums.size(), kViews);  // the last ten iterations, each another view: none is swept
  for (const auto& [iteration, sum] : sums) {
    const double loss = static_cast<double>(trainer.history().records[iteration - 1].loss);
    EXPECT_GT(loss, 1e-3);
    for (size_t i = 0; i < kSplats; ++i) outcome.expected[i] += 50 * loss * sum[i];
  }
  return outcome;
}

TEST(TamingFit, TheScoresAreThePublishedSumWithTheLossesOfTheViews) {
  const Outcome fit = scoresOfAFit(false);
  ASSERT_EQ(fit.told.size(), kSplats);
  for (size_t i = 0; i < kSplats; ++i) {
    // Losses are recorded, and scores are handed out, in float32: 6e-8 each. Pulls are summed in
    // float32 over a hundred iterations, which rounds them by up to 100 * 6e-8.
    EXPECT_NEAR(fit.told[i], fit.expected[i], 1e-5 * fit.expected[i]) << i;
  }
  const auto [least, most] = std::minmax_element(fit.told.begin(), fit.told.end());
  EXPECT_GT(*least, 0);
  EXPECT_GT(*most, 2 * *least);
}

TEST(TamingFit, ALossOfZeroWouldShow) {
  const Outcome fit = scoresOfAFit(true);
  ASSERT_EQ(fit.told.size(), kSplats);
  for (size_t i = 0; i < kSplats; ++i) {
    EXPECT_EQ(fit.told[i], 0) << i;
    EXPECT_GT(fit.expected[i], 0) << i;
  }
}

}  // namespace
}  // namespace stipple
