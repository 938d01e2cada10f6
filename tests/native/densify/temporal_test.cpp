// The strategy "temporal" and its parts, each alone.

#include "densify/strategies/temporal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "densify/control_cases.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using namespace stipple::testing;
using ::testing::HasSubstr;

/// What a view says, with how opaque and of what temporal scale each splat is in it.
struct Shown {
  Seen seen;
  std::vector<float> opacities, lifespans;

  ViewStatistics statistics() const {
    ViewStatistics view = seen.statistics();
    view.splats.opacities = opacities;
    view.splats.lifespans = lifespans;
    return view;
  }
};

std::vector<float> scoresOf(Strategy& strategy, const std::vector<Shown>& views, size_t count) {
  for (const Shown& view : views) strategy.observe(at(599), view.statistics());
  // Small and opaque: they would be copied. No room: they stay, with their scores.
  const RawSplats splats = splatsOf(std::vector<Kind>(count, {0.001f, 0.9f}));
  editAt(strategy, at(600, count), splats);
  return strategy.seen(count).score;
}

// ---- visibility_weighted_score ------------------------------------------------------------------

TEST(VisibilityWeightedScore, AveragesPullsByHowOpaqueTheSplatIs) {
  const auto strategy = makeStrategy("adaptive+visibility_weighted_score");
  // By hand, of 2e-4: (0.5 1e-4 + 1 4e-4) / 1.5 = 3e-4.
  const std::vector<float> scores =
      scoresOf(*strategy, {{Seen({1e-4f}), {0.5f}, {}}, {Seen({-4e-4f}), {1.0f}, {}}}, 1);
  ASSERT_EQ(scores.size(), 1u);
  EXPECT_NEAR(scores[0], 1.5, 1e-6);  // a few roundings of float32
}

TEST(VisibilityWeightedScore, FindsThePullOnASplatThatFadesAwayInMostViews) {
  std::vector<Shown> views(10, {Seen({0.0f}), {0.04f}, {}});
  views[3] = {Seen({3e-4f}), {0.8f}, {}};
  EXPECT_NEAR(scoresOf(*makeStrategy("adaptive"), views, 1)[0], 0.15, 1e-6);
  const auto weighted = makeStrategy("adaptive+visibility_weighted_score");
  EXPECT_NEAR(scoresOf(*weighted, views, 1)[0], 1.5, 1e-6);
  // At the gate it counts as not seen: 0.05 itself too.
  for (Shown& view : views) view.opacities = {0.05f};
  const auto faint = makeStrategy("adaptive+visibility_weighted_score");
  EXPECT_EQ(scoresOf(*faint, views, 1)[0], 0);
}

TEST(VisibilityWeightedScore, IsTheUsualAverageWhereAllIsOpaque) {
  std::vector<Shown> views;
  for (int v = 0; v < 7; ++v) {
    const float pull = 1e-4f * static_cast<float>(v);
    views.push_back({Seen({pull, 2 * pull, 5e-5f}), {1, 1, 1}, {}});
  }
  EXPECT_EQ(scoresOf(*makeStrategy("adaptive+visibility_weighted_score"), views, 3),
            scoresOf(*makeStrategy("adaptive"), views, 3));
}

TEST(VisibilityWeightedScore, AsksForDrawnSplatsAndKeepsItsSums) {
  const auto strategy = makeStrategy("adaptive+visibility_weighted_score");
  const StatisticRequest request = strategy->requests(at(300));
  EXPECT_TRUE(request.drawn_splats && request.screen_gradients);
  EXPECT_FALSE(request.lifespans);
  EXPECT_FALSE(makeStrategy("adaptive")->requests(at(300)).drawn_splats);
  EXPECT_FALSE(strategy->requests(at(16000)).any());
  // A checkpoint between two views changes nothing.
  const Shown first = {Seen({1e-4f}), {0.5f}, {}}, second = {Seen({4e-4f}), {1.0f}, {}};
  strategy->observe(at(598), first.statistics());
  const auto resumed = makeStrategy("adaptive+visibility_weighted_score");
  const TensorTable state = strategy->state();
  resumed->restore(state);
  EXPECT_EQ(scoresOf(*resumed, {second}, 1), scoresOf(*strategy, {second}, 1));
  TensorTable lacking = state;
  ASSERT_EQ(lacking.erase("visibility_weighted_score.opacity_sums"), 1u);
  EXPECT_THROW(makeStrategy("adaptive+visibility_weighted_score")->restore(lacking), Error);
}

// ---- lifespan_threshold -------------------------------------------------------------------------

ControlMoment learning() {
  return controlMoment(at(599), {});
}

TEST(LifespanThreshold, FollowsThePublishedCurve) {
  // Least 0.75, power 0.8, to four digits.
  const std::vector<std::pair<float, double>> curve = {
      {0.0f, 0.7500}, {0.05f, 0.7728}, {0.1f, 0.7896}, {0.2f, 0.8190}, {0.3f, 0.8454},
      {0.5f, 0.8936}, {0.7f, 0.9379},  {1.0f, 1.0000}, {1.1f, 1.0000}};
  Shown view = {Seen(std::vector<float>(curve.size(), 0.0f)), {}, {}};
  for (const auto& [lifespan, share] : curve) {
    view.lifespans.push_back(lifespan);
    view.opacities.push_back(0.5f);
  }
  const auto part = makeLifespanThreshold();
  part->observe(learning(), view.statistics());
  const std::vector<float> shares = part->thresholdShares(learning(), curve.size());
  for (size_t i = 0; i < curve.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(shares[i]), curve[i].second, 5.1e-5) << curve[i].first;
  }
}

TEST(LifespanThreshold, TakesTheMeanOfTheViewsThatShowASplat) {
  const auto part = makeLifespanThreshold({0.5, 1});
  Shown view = {Seen({0, 0, 0, 0}), {0.5f, 0.5f, 0.05f, 0.5f}, {0.2f, 0.2f, 0.2f, 0.2f}};
  view.seen.visible[3] = 0;
  part->observe(learning(), view.statistics());
  view.lifespans = {0.6f, 0.2f, 0.2f, 0.2f};
  view.opacities[1] = 0.01f;
  part->observe(learning(), view.statistics());
  const std::vector<float> shares = part->thresholdShares(learning(), 4);
  EXPECT_FLOAT_EQ(shares[0], 0.7f);  // 0.4, of which a half, and a half
  EXPECT_FLOAT_EQ(shares[1], 0.6f);  // 0.2: the second view did not show it
  EXPECT_EQ(shares[2], 1);           // too faint
  EXPECT_EQ(shares[3], 1);           // beside the image
}

TEST(LifespanThreshold, LeavesThresholdsWholeWhereNothingMoves) {
  const auto part = makeLifespanThreshold();
  part->observe(learning(), Shown{Seen({1, 1}), {1, 1}, {}}.statistics());
  EXPECT_EQ(part->thresholdShares(learning(), 2), (std::vector<float>{1, 1}));
  EXPECT_EQ(part->thresholdShares(learning(), 0), std::vector<float>{});
}

TEST(LifespanThreshold, LetsAShortLivedSplatMultiplyAtAWeakerPull) {
  // 1.6e-4 is below 2e-4, and above 0.7728 of it.
  const std::vector<Shown> views = {{Seen({1.6e-4f, 1.6e-4f}), {1, 1}, {0.05f, 1}}};
  const auto strategy = makeStrategy("adaptive+lifespan_threshold");
  EXPECT_TRUE(strategy->requests(at(300)).lifespans);
  for (const Shown& view : views) strategy->observe(at(599), view.statistics());
  const RawSplats splats = splatsOf({{0.001f, 0.9f}, {0.001f, 0.9f}});
  const auto edit = editAt(*strategy, at(600), splats);
  ASSERT_TRUE(edit);
  ASSERT_EQ(edit->append.size(), 1u);
  EXPECT_EQ(edit->append.positions[0], 0);  // the first one's
  EXPECT_NEAR(strategy->seen(3).score[0], 0.8 / 0.77276, 1e-4);
  // And the window begins anew.
  EXPECT_EQ(scoresOf(*strategy, {}, 3), std::vector<float>(3, 0.0f));
}

TEST(LifespanThreshold, KeepsItsSums) {
  const auto part = makeLifespanThreshold(), resumed = makeLifespanThreshold();
  const Shown view = {Seen({0, 0}), {1, 1}, {0.1f, 0.7f}};
  part->observe(learning(), view.statistics());
  TensorTable table;
  part->put(table);
  resumed->take(table);
  EXPECT_EQ(resumed->thresholdShares(learning(), 2), part->thresholdShares(learning(), 2));
  std::get<std::vector<float>>(table["lifespan_sums"].values).pop_back();
  EXPECT_THROW(resumed->take(table), Error);
}

TEST(LifespanThreshold, IsRefusedWhereNobodyHasAThreshold) {
  for (const char* name : {"mcmc", "frequency"}) {
    try {
      makeStrategy(std::string(name) + "+lifespan_threshold");
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("lifespan_threshold does not go with "));
      EXPECT_THAT(error.what(), HasSubstr("decides without a threshold"));
    }
  }
}

// ---- offset_warp --------------------------------------------------------------------------------

TimeStretch stretchOf(const std::string& strategy) {
  TimeStretch stretch;
  makeStrategy(strategy)->adjustStretch(stretch);
  return stretch;
}

TEST(OffsetWarp, SaysHowTimeIsStretched) {
  EXPECT_EQ(stretchOf("adaptive").frames, 0);
  EXPECT_EQ(stretchOf("adaptive+offset_warp").frames, 50);
  EXPECT_EQ(stretchOf("adaptive+offset_warp").share, 0.7);
  EXPECT_EQ(stretchOf("mcmc+offset_warp(frames=30,share=0.6)").frames, 30);
  EXPECT_EQ(stretchOf("mcmc+offset_warp(frames=30,share=0.6)").share, 0.6);
  EXPECT_EQ(stretchOf("temporal").frames, 50);
  EXPECT_EQ(stretchOf("temporal+offset_warp(frames=20)").frames, 20);
  EXPECT_THROW(makeStrategy("adaptive+offset_warp(share=1)"), Error);
}

// ---- temporal -----------------------------------------------------------------------------------

TEST(Temporal, HasTheScheduleAndRatesOfTheReleasedProgram) {
  const auto strategy = makeStrategy("temporal");
  const RawSplats splats = splatsOf({{0.001f, 0.9f}});
  const auto isEvent = [&](uint64_t iteration) {
    return editAt(*strategy, at(iteration), splats).has_value();
  };
  EXPECT_FALSE(isEvent(400));
  EXPECT_FALSE(isEvent(500));
  EXPECT_TRUE(isEvent(600));
  EXPECT_FALSE(isEvent(700));
  EXPECT_TRUE(isEvent(16800));
  EXPECT_FALSE(isEvent(17000));
  LearningRates rates;
  strategy->adjustRates(rates);
  EXPECT_EQ(rates.first_position, 2.6e-4);
  EXPECT_EQ(rates.last_position, 2.6e-6);
  EXPECT_EQ(rates.log_scale, 1.5e-3);
  EXPECT_EQ(rates.logit, 0.05);
  EXPECT_EQ(rates.rotation, 1e-3);
  EXPECT_EQ(rates.colour, 2.5e-3);
  EXPECT_EQ(rates.higher_colour, 1.25e-4);
}

TEST(Temporal, CanLeaveOutEachOfItsThreeParts) {
  // One view in ten shows it: of 2e-4, a pull of 3e-4 as a plain mean is 0.15, 1.5 where it counts.
  std::vector<Shown> views(10, {Seen({0.0f}), {0.04f}, {0.2f}});
  views[3] = {Seen({3e-4f}), {0.8f}, {0.2f}};
  const auto scoreOf = [&](const char* strategy) {
    return static_cast<double>(scoresOf(*makeStrategy(strategy), views, 1)[0]);
  };
  const double share = 0.75 + 0.25 * std::pow(0.2, 0.8);  // the threshold of such a lifespan
  EXPECT_NEAR(scoreOf("temporal"), 1.5 / share, 1e-5);
  EXPECT_NEAR(scoreOf("temporal(by_lifespan=0)"), 1.5, 1e-5);
  EXPECT_NEAR(scoreOf("temporal(weighted=0)"), 0.15 / share, 1e-5);
  EXPECT_NEAR(scoreOf("temporal(weighted=0,by_lifespan=0,stretched=0)"), 0.15, 1e-5);
  EXPECT_EQ(stretchOf("temporal(stretched=0)").frames, 0);
}

TEST(Temporal, CopiesSmallSplatsSplitsLargeOnesAndRemovesTheFaintAlone) {
  const auto strategy = makeStrategy("temporal");
  // Beyond 0.01 of the extent of 1 a splat is large; however large, it stays.
  const RawSplats splats = splatsOf({{0.001f, 0.9f}, {0.5f, 0.9f}, {0.5f, 0.9f}, {0.001f, 0.004f}});
  const Shown view = {Seen({3e-4f, 3e-4f, 0, 0}), {1, 1, 1, 0.004f}, {1, 1, 1, 1}};
  strategy->observe(at(3999), view.statistics());
  const auto edit = editAt(*strategy, at(4000), splats);
  ASSERT_TRUE(edit && edit->keep);
  EXPECT_EQ(*edit->keep, (std::vector<uint32_t>{0, 2}));
  ASSERT_EQ(edit->append.size(), 3u);
  EXPECT_EQ(edit->append.log_scales[0], splats.log_scales[0]);
  for (size_t child = 1; child < 3; ++child) {
    EXPECT_NEAR(edit->append.log_scales[child * 3], std::log(0.5 / 1.6), 1e-6);
  }
}

}  // namespace
}  // namespace stipple
