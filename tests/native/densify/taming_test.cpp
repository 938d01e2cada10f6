#include "densify/strategies/taming.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/parallel.h"
#include "control_scene.h"
#include "densify/known_views.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using testing::after;
using testing::at;
using testing::editAt;
using ::testing::ElementsAre;
using testing::forwardCamera;
using ::testing::HasSubstr;
using testing::iterate;
using testing::Kind;
using testing::KnownView;
using testing::KnownViews;
using testing::messageOf;
using testing::plainView;
using testing::Seen;
using testing::splatsOf;

/// Views that tell of each splat what the test says; their pictures are half right.
class Told final : public ViewEvaluator {
 public:
  /// In: covered, one number per splat: pixels, distances, errors and blending weights alike.
  Told(const RawSplats& splats, std::vector<float> covered, size_t views = 3)
      : cloud_(activated(splats)),
        covered_(std::move(covered)),
        visible_(splats.size(), 1),
        view_count_(views) {
    camera_.width = camera_.height = 8;
    camera_.fx = camera_.fy = 8;
    camera_.cx = camera_.cy = 4;
    camera_.world_to_camera(2, 3) = 2;
  }
  size_t viewCount() const override { return view_count_; }
  const SplatCloud& splats() override { return cloud_; }
  const Camera& camera(size_t) const override { return camera_; }
  std::vector<float> target(size_t) override { return std::vector<float>(8 * 8 * 3, grey_); }
  std::vector<float> picture(size_t view) override {
    std::vector<float> colours = target(view);
    for (size_t k = 0; k < colours.size() / 2; ++k) colours[k] = 0.5f;
    return colours;
  }
  const ViewStatistics& evaluate(size_t view, const StatisticRequest& request) override {
    ++looks;
    EXPECT_TRUE(request.covered);
    EXPECT_TRUE(request.blending_weights);
    const std::vector<float> wanted = target(view), made = picture(view);
    std::vector<float> rgba(made.size() / 3 * 4, 1.0f);
    for (size_t k = 0; k < made.size(); ++k) rgba[k / 3 * 4 + k % 3] = made[k];
    const std::vector<float> weights = request.errors_of({8, 8, {}, rgba, wanted, {}});
    largest_pixel_weight = *std::max_element(weights.begin(), weights.end());
    return told(view);
  }
  /// What an iteration with this view shows. Valid until the next call.
  const ViewStatistics& told(size_t view) {
    statistics_ = {};
    statistics_.splats = {cloud_.positions, cloud_.rotations, cloud_.scales, cloud_.opacities};
    statistics_.view = view;
    statistics_.width = statistics_.height = 8;
    statistics_.camera = &camera_;
    statistics_.visible = visible_;
    statistics_.loss = 0.5;
    for (const Statistic which : {Statistic::kCoveredPixels, Statistic::kCoveredErrors,
                                  Statistic::kCoveredDistances, Statistic::kBlendingWeights}) {
      statistics_.arrays[static_cast<size_t>(which)] = covered_;
    }
    return statistics_;
  }
  void hide(size_t splat) { visible_[splat] = 0; }
  void setGrey(float grey) { grey_ = grey; }

  int looks = 0;
  float largest_pixel_weight = 0;

 private:
  SplatCloud cloud_;
  std::vector<float> covered_;
  std::vector<uint8_t> visible_;
  size_t view_count_;
  Camera camera_;
  ViewStatistics statistics_;
  float grey_ = 0.25f;
};

/// An event after one observed view. In: pulls, per splat in units of half a picture.
std::optional<SplatEdit> event(Strategy& strategy, const RawSplats& splats,
                               const std::vector<float>& pulls, ViewEvaluator& views,
                               uint64_t iteration, uint64_t cap) {
  const Seen seen(pulls);
  strategy.observe(at(iteration - 50, cap), seen.statistics());
  EXPECT_TRUE(strategy.wantsSweep(at(iteration, cap)));
  strategy.sweep(at(iteration, cap), views);
  return editAt(strategy, at(iteration, cap), splats);
}

TEST(Taming, TheCurveGoesFromTheStartToTheBudgetAndEndsSlowly) {
  EXPECT_EQ(tamingCount(1000, 5000, 0), 1000u);
  EXPECT_EQ(tamingCount(1000, 5000, 1), 5000u);
  EXPECT_EQ(tamingCount(1000, 5000, 0.5), 4000u);
  uint64_t before = 0;
  for (int k = 0; k <= 100; ++k) {
    const uint64_t now = tamingCount(1000, 5000, 0.01 * k);
    EXPECT_GE(now, before);
    before = now;
  }
  EXPECT_EQ(tamingCount(5000, 1000, 1), 1000u);  // a cap below the start
}

TEST(Taming, AddsWhatTheCurveAllowsAndEndsAtTheCap) {
  // 1,000 splats, a cap of 2,000: event 0 of 144 allows 1000 + 1000 (1 - (143/144)^2) = 1013.
  const RawSplats splats = splatsOf(std::vector<Kind>(1000, {0.001f, 0.5f}));
  const std::vector<float> pulls(1000, 1e-3f);
  const auto strategy = makeStrategy("taming");
  Told views(splats, std::vector<float>(1000, 1.0f));
  EXPECT_EQ(event(*strategy, splats, pulls, views, 600, 2000)->countAfter(1000), 1013u);
  const auto last = makeStrategy("taming");
  EXPECT_EQ(event(*last, splats, pulls, views, 14900, 1500)->countAfter(1000), 1500u);
  const auto free = makeStrategy("taming(budget=1.25)");
  EXPECT_EQ(event(*free, splats, pulls, views, 14900, 0)->countAfter(1000), 1250u);
}

TEST(Taming, PullsBelowTheThresholdMultiplyNothingWhateverTheBudget) {
  const RawSplats splats = splatsOf(std::vector<Kind>(10, {0.001f, 0.5f}));
  const auto strategy = makeStrategy("taming");
  Told views(splats, std::vector<float>(10, 1.0f));
  EXPECT_EQ(
      event(*strategy, splats, std::vector<float>(10, 0.0f), views, 14900, 100)->countAfter(10),
      10u);
}

TEST(Taming, CopiesAndSplitsShareTheRoomInProportion) {
  // 60 small and 40 large ones qualify; room for 50: 30 copies and 20 splits.
  std::vector<Kind> kinds(60, {0.001f, 0.5f});
  kinds.resize(100, {0.02f, 0.5f});
  const RawSplats splats = splatsOf(kinds);
  const auto strategy = makeStrategy("taming");
  Told views(splats, std::vector<float>(100, 1.0f));
  const auto edit = event(*strategy, splats, std::vector<float>(100, 1e-3f), views, 14900, 150);
  EXPECT_EQ(edit->countAfter(100), 150u);
  EXPECT_EQ(edit->keep->size(), 80u);
  EXPECT_EQ(edit->append.size(), 30u + 40u);
}

TEST(Taming, DrawsThoseThatMatterMost) {
  // One of a hundred covers ten thousand times as much as the others: it is all but certain to be
  // among the ten that are drawn.
  const RawSplats splats = splatsOf(std::vector<Kind>(100, {0.001f, 0.5f}));
  std::vector<float> covered(100, 1.0f);
  covered[42] = 1e4f;
  const auto strategy = makeStrategy("taming");
  Told views(splats, covered);
  const auto edit = event(*strategy, splats, std::vector<float>(100, 1e-3f), views, 14900, 110);
  ASSERT_EQ(edit->append.size(), 10u);
  bool has_it = false;
  for (size_t k = 0; k < 10; ++k) has_it = has_it || edit->append.positions[k * 3] == 42.0f;
  EXPECT_TRUE(has_it);
}

TEST(Taming, TheScoreIsThatOfThePublishedSum) {
  const RawSplats splats = splatsOf({{0.001f, 0.5f}, {0.002f, 0.25f}, {0.004f, 0.75f}});
  const auto strategy = makeStrategy("taming");
  Told views(splats, {1, 3, 5});
  event(*strategy, splats, {1e-3f, 2e-3f, 4e-3f}, views, 600, 3);
  const std::vector<float> score = strategy->seen(3).score;
  ASSERT_EQ(score.size(), 3u);
  // Over medians: pulls 1/2, 1, 2; opacities 1, 1/2, 3/2; depths 1; radii 1, as all are far smaller
  // than the blur of 0.3 px^2; volumes 1/8, 1, 8; what they cover 1/3, 1, 5/3. Three views of loss
  // 0.5, times 50.
  const double covered = 50 + 10 + 0.1 + 50;
  const double expected[3] = {25 * 0.5 + 100 + 5 + 10 + 25.0 / 8 + covered / 3,
                              25 + 100 * 0.5 + 5 + 10 + 25 + covered,
                              25 * 2 + 100 * 1.5 + 5 + 10 + 25 * 8 + covered * 5 / 3};
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(score[i], 75 * expected[i], 1e-6 * 75 * expected[i]);  // stored in float32
  }
}

TEST(Taming, ViewsThatIterationsHaveDrawnAreNotDrawnAgain) {
  const RawSplats splats = splatsOf(std::vector<Kind>(30, {0.001f, 0.5f}));
  KnownViews views;
  views.cloud = activated(splats);
  for (size_t v = 0; v < 12; ++v) {
    KnownView view = plainView(forwardCamera(20, 20, 20), 0.5f, 0.25f);
    view.visible.assign(30, 1);
    view.of(Statistic::kScreenGradients).assign(60, 1e-3f);
    for (const Statistic which : {Statistic::kCoveredPixels, Statistic::kCoveredErrors,
                                  Statistic::kCoveredDistances, Statistic::kBlendingWeights}) {
      for (size_t i = 0; i < 30; ++i) view.of(which).push_back(static_cast<float>((i * v) % 7));
    }
    views.views.push_back(std::move(view));
  }
  const auto strategy = makeStrategy("taming");
  uint64_t iteration = 589;
  for (const size_t view : {11, 10, 0, 1, 2, 3, 3, 4, 5, 6, 7, 8}) {
    const bool is_again = iteration == 595;
    const StatisticRequest request = iterate(*strategy, views, at(iteration, 40), view);
    EXPECT_TRUE(request.screen_gradients);
    EXPECT_EQ(request.covered, iteration > 590 && !is_again) << iteration;
    EXPECT_EQ(static_cast<bool>(request.errors_of), request.covered);
    ++iteration;
  }
  // Nine views were looked at; the tenth is drawn.
  const auto other = makeStrategy("taming");
  other->restore(strategy->state());
  strategy->sweep(at(600, 40), views);
  ASSERT_EQ(views.drawn.size(), 1u);
  EXPECT_GE(views.drawn[0], 9u);
  other->sweep(at(600, 40), views);
  EXPECT_EQ(editAt(*strategy, at(600, 40), splats)->append.positions,
            editAt(*other, at(600, 40), splats)->append.positions);
  EXPECT_EQ(strategy->seen(30).score, other->seen(30).score);
}

TEST(Taming, LooksAtTenViewsAtMost) {
  const RawSplats splats = splatsOf({{0.001f, 0.5f}});
  const auto strategy = makeStrategy("taming");
  Told few(splats, {1.0f}, 3), many(splats, {1.0f}, 200);
  event(*strategy, splats, {1e-3f}, few, 600, 10);
  EXPECT_EQ(few.looks, 3);
  event(*strategy, splats, {1e-3f}, many, 700, 10);
  EXPECT_EQ(many.looks, 10);
  EXPECT_FALSE(strategy->wantsSweep(at(650)));
}

TEST(Taming, APictureWithoutErrorOrEdgeIsNoTrouble) {
  const RawSplats splats = splatsOf(std::vector<Kind>(4, {0.001f, 0.5f}));
  const auto strategy = makeStrategy("taming");
  Told views(splats, std::vector<float>(4, 0.0f));
  views.setGrey(0.5f);  // the picture is as it should be: errors have no span, edges neither
  for (size_t i = 0; i < 4; ++i) views.hide(i);
  const auto edit = event(*strategy, splats, std::vector<float>(4, 1e-3f), views, 14900, 6);
  EXPECT_EQ(views.largest_pixel_weight, 0.0f);
  EXPECT_EQ(edit->countAfter(4), 6u);  // nobody is told apart: all are alike
}

TEST(Taming, RemovesHalfOfTheFaintOnesAndOnlyEarly) {
  std::vector<Kind> kinds(40, {0.001f, 0.001f});
  kinds.resize(50, {0.001f, 0.5f});
  const RawSplats splats = splatsOf(kinds);
  const std::vector<float> none(50, 0.0f);
  Told views(splats, std::vector<float>(50, 1.0f));
  const auto early = makeStrategy("taming");
  const auto edit = event(*early, splats, none, views, 600, 100);
  ASSERT_TRUE(edit->keep);
  EXPECT_EQ(edit->keep->size(), 30u);
  EXPECT_EQ(edit->keep->back(), 49u);
  const auto late = makeStrategy("taming");
  EXPECT_FALSE(event(*late, splats, none, views, 3300, 100)->keep);
}

TEST(Taming, KeepsThoseThatMatterAmongTheFaint) {
  const RawSplats splats = splatsOf(std::vector<Kind>(20, {0.001f, 0.001f}));
  std::vector<float> covered(20, 1.0f);
  covered[7] = 1e6f;
  const auto strategy = makeStrategy("taming");
  Told views(splats, covered);
  const auto edit = event(*strategy, splats, std::vector<float>(20, 0.0f), views, 600, 100);
  EXPECT_EQ(edit->keep->size(), 10u);
  // Its weight is a ten-thousandth of the others'.
  EXPECT_THAT(*edit->keep, ::testing::Contains(7u));
}

TEST(Taming, GoesOnFromItsState) {
  const RawSplats splats = splatsOf(std::vector<Kind>(100, {0.001f, 0.5f}));
  const std::vector<float> pulls(100, 1e-3f);
  Told views(splats, std::vector<float>(100, 1.0f));
  const auto first = makeStrategy("taming"), second = makeStrategy("taming");
  const RawSplats grown = after(*event(*first, splats, pulls, views, 600, 1000), splats);
  second->restore(first->state());
  Told later(grown, std::vector<float>(grown.size(), 1.0f));
  const std::vector<float> more(grown.size(), 1e-3f);
  const auto a = event(*first, grown, more, later, 700, 1000);
  const auto b = event(*second, grown, more, later, 700, 1000);
  EXPECT_EQ(a->append.positions, b->append.positions);
  EXPECT_GT(a->append.size(), 0u);
  TensorTable broken = first->state();
  broken["taming_growth.start"] = {{0}, std::vector<uint64_t>{}};
  EXPECT_THAT(messageOf([&] { second->restore(broken); }), HasSubstr("numbers in start"));
}

TEST(Taming, GivesTheSameForAnyThreads) {
  const RawSplats splats = splatsOf(std::vector<Kind>(20000, {0.02f, 0.5f}));
  std::vector<float> covered(20000);
  for (size_t i = 0; i < covered.size(); ++i) covered[i] = static_cast<float>((i * 7919) % 997);
  std::vector<float> made[2];
  for (unsigned threads = 1; threads <= 2; ++threads) {
    withThreads(threads, [&] {
      const auto strategy = makeStrategy("taming");
      Told views(splats, covered);
      made[threads - 1] =
          event(*strategy, splats, std::vector<float>(20000, 1e-3f), views, 5000, 30000)
              ->append.positions;
    });
  }
  EXPECT_EQ(made[0], made[1]);
}

TEST(Taming, SlowsOpacitiesDown) {
  LearningRates rates;
  makeStrategy("taming")->adjustRates(rates);
  EXPECT_EQ(rates.logit, 0.025);
}

}  // namespace
}  // namespace stipple
