#include "densify/strategies/improved.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/parallel.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using namespace stipple::testing;

/// One view, then the edit of an iteration.
std::optional<SplatEdit> editAfterView(const std::vector<Kind>& kinds, const Seen& seen,
                                       uint64_t iteration = 600, uint64_t max_splats = 0) {
  const auto strategy = makeStrategy("improved");
  strategy->observe(at(iteration - 50), seen.statistics());
  return editAt(*strategy, at(iteration, max_splats), splatsOf(kinds));
}

Seen absolute(const std::vector<float>& gradients) {
  return Seen(std::vector<float>(gradients.size(), 0.0f), gradients);
}

TEST(Improved, SplitsSplatsOfAnySizeAlongTheirLongestAxis) {
  const auto edit = editAfterView({{0.0001f, 0.5f}, {0.5f, 0.5f}, {0.5f, 0.5f}},
                                  absolute({3.1e-4f, 3.1e-4f, 2.9e-4f}));
  ASSERT_TRUE(edit);
  EXPECT_THAT(*edit->keep, ElementsAre(2));
  ASSERT_EQ(edit->append.size(), 4u);
  EXPECT_NEAR(edit->append.positions[0], 1.35e-4f, 1e-9f);
  EXPECT_NEAR(edit->append.positions[6], 1 + 1.35f * 0.5f, 2e-7f);
  for (const float logit : edit->append.logits) EXPECT_NEAR(activatedOpacity(logit), 0.3f, 1e-6f);
}

TEST(Improved, TheThresholdFallsLate) {
  const std::vector<Kind> kinds = {{0.01f, 0.5f}, {0.01f, 0.5f}};
  const Seen seen = absolute({2.1e-4f, 1.9e-4f});
  EXPECT_EQ(editAfterView(kinds, seen, 14500)->append.size(), 0u);
  EXPECT_EQ(editAfterView(kinds, seen, 14600)->append.size(), 2u);
}

TEST(Improved, KeepsThePublishedSchedule) {
  const auto strategy = makeStrategy("improved");
  const Kind kind{0.2f, 0.5f};
  RawSplats splats = splatsOf(std::vector<Kind>(10, kind));
  std::vector<uint64_t> events, resets, recoveries;
  for (uint64_t iteration = 1; iteration <= 30000; ++iteration) {
    const auto edit = editAt(*strategy, at(iteration), splats);
    EXPECT_EQ(strategy->requests(at(iteration)).absolute_screen_gradients, iteration < 15000);
    if (!edit) continue;
    if (iteration % 100 == 0) events.push_back(iteration);
    if (!edit->writes.empty()) resets.push_back(iteration);
    if (edit->keep) recoveries.push_back(iteration);
    // The strategy counts on its edit's splats next; unlike theirs, these opacities stay as they
    // are.
    splats = splatsOf(std::vector<Kind>(after(*edit, splats).size(), kind));
  }
  EXPECT_EQ(events.size(), 144u);
  EXPECT_EQ(events.front(), 600u);
  EXPECT_EQ(events.back(), 14900u);
  EXPECT_THAT(resets, ElementsAre(3000, 6000, 9000, 12000));
  EXPECT_THAT(recoveries, ElementsAre(3300, 6300));  // and nothing goes for its size
}

TEST(Improved, FaintSplatsGoOnceEarlyAndThenAtEvents) {
  const std::vector<Kind> kinds = {{0.01f, 0.019f}, {0.01f, 0.021f}, {0.01f, 0.0049f}};
  const auto keptAt = [&](uint64_t iteration) {
    const auto edit = editAt(*makeStrategy("improved"), at(iteration), splatsOf(kinds));
    return edit && edit->keep ? *edit->keep : std::vector<uint32_t>{0, 1, 2};
  };
  EXPECT_THAT(keptAt(299), ElementsAre(0, 1, 2));
  EXPECT_THAT(keptAt(300), ElementsAre(1));
  EXPECT_THAT(keptAt(301), ElementsAre(0, 1, 2));
  EXPECT_THAT(keptAt(600), ElementsAre(0, 1));
  EXPECT_THAT(keptAt(14800), ElementsAre(0, 1));
  EXPECT_THAT(keptAt(14900), ElementsAre(0, 1, 2));
}

TEST(Improved, AFaintSplatThatSplitsIsGone) {
  // 0.6 times 0.008 is below 0.005.
  const auto edit = editAfterView({{0.01f, 0.008f}, {0.01f, 0.5f}}, absolute({1, 0}));
  EXPECT_THAT(*edit->keep, ElementsAre(1));
  EXPECT_EQ(edit->append.size(), 0u);
}

TEST(Improved, ResetsToMoreThanOthers) {
  const RawSplats splats = splatsOf({{0.01f, 0.9f}});
  const RawSplats now = after(*editAt(*makeStrategy("improved"), at(3000), splats), splats);
  EXPECT_NEAR(now.logits[0], -2.944439f, 1e-5f);
}

TEST(Improved, LearnsAtItsOwnRates) {
  LearningRates rates;
  makeStrategy("improved")->adjustRates(rates);
  EXPECT_EQ(rates.first_position, 4e-5);
  EXPECT_EQ(rates.last_position, 2e-6);
  EXPECT_EQ(rates.logit, 0.025);
  EXPECT_EQ(rates.higher_colour, 2.5e-4);
  EXPECT_EQ(rates.log_scale, LearningRates().log_scale);
  LearningRates usual;
  makeStrategy("adaptive+long_axis_split")->adjustRates(usual);
  EXPECT_EQ(usual.first_position, LearningRates().first_position);
}

TEST(Improved, GrowsAlongTheCurve) {
  // 1000 sqrt(100 / 14000) = 84.5.
  const std::vector<Kind> kinds(80, {0.01f, 0.5f});
  const Seen seen = absolute(std::vector<float>(80, 1));
  EXPECT_EQ(editAfterView(kinds, seen, 600, 1000)->countAfter(80), 84u);
  EXPECT_EQ(editAfterView(kinds, seen, 600, 50)->countAfter(80), 80u);
  EXPECT_EQ(editAfterView(kinds, seen)->countAfter(80), 160u);  // of the usual million
}

TEST(Improved, HardInputsChangeNothing) {
  for (const size_t count : {1u, 6u}) {
    const std::vector<Kind> kinds(count, {0.01f, 0.5f});
    const auto edit = editAfterView(kinds, absolute(std::vector<float>(count, 0.0f)));
    EXPECT_FALSE(edit->keep);
    EXPECT_EQ(edit->append.size(), 0u);
  }
  EXPECT_EQ(editAfterView({{0.01f, 0.5f}}, absolute({1}))->countAfter(1), 2u);
  EXPECT_FALSE(editAt(*makeStrategy("improved"), at(600), RawSplats()));
  EXPECT_FALSE(editAt(*makeStrategy("improved"), at(3300), RawSplats()));
}

TEST(Improved, EqualSplatsAreChosenFromEverywhere) {
  // Rows lie in the order of the scene: 500 of 1000 alike, at an event and at a recovery.
  const std::vector<Kind> kinds(1000, {0.01f, 0.5f});
  const auto strategy = makeStrategy("improved");
  strategy->observe(at(14550), absolute(std::vector<float>(1000, 1)).statistics());
  const auto edit = editAt(*strategy, at(14600, 1500), splatsOf(kinds));
  ASSERT_EQ(edit->countAfter(1000), 1500u);
  double mean = 0;
  for (const uint32_t row : *edit->keep) mean += row / 500.0;
  EXPECT_NEAR(mean, 500, 52);  // four standard errors: 4 * 1000 / sqrt(12 * 500)
}

TEST(Improved, GoesOnFromItsStateInTheMiddleOfAWindow) {
  const std::vector<Kind> kinds(300, {0.01f, 0.5f});
  std::vector<float> pulls(300);
  for (size_t i = 0; i < 300; ++i) pulls[i] = 3e-6f * static_cast<float>(i);
  const auto whole = makeStrategy("improved"), half = makeStrategy("improved");
  whole->observe(at(501), absolute(pulls).statistics());
  half->restore(whole->state());
  std::vector<float> places[2];
  for (const unsigned threads : {1u, 2u}) {
    Strategy& strategy = threads == 1 ? *whole : *half;
    withThreads(threads, [&] {
      strategy.observe(at(502), absolute(std::vector<float>(300, 2e-4f)).statistics());
      const auto edit = editAt(strategy, at(600, 4000), splatsOf(kinds));
      places[threads - 1] = {edit->append.positions.begin(), edit->append.positions.end()};
    });
  }
  EXPECT_EQ(places[0], places[1]);
  EXPECT_EQ(places[0].size() / 3, 2u * 38);  // 4000 sqrt(1 / 140) = 338.06
}

TEST(Improved, ItsPartsGoWithOtherStrategies) {
  for (const char* name :
       {"adaptive+edge_aware_score+long_axis_split+recovery_pruning+growth_control+multi_step_"
        "update",
        "absolute+edge_aware_score+opacity_correction", "direction+long_axis_split+growth_control",
        "improved+growth_control(splats=5)", "improved+long_axis_split(offset=0.5)"}) {
    const auto strategy = makeStrategy(name);
    const size_t count = 40;
    strategy->observe(at(501), absolute(std::vector<float>(count, 1)).statistics());
    const auto edit =
        editAt(*strategy, at(600, 45), splatsOf(std::vector<Kind>(count, {0.01f, 0.5f})));
    EXPECT_LE(edit->countAfter(count), 45u) << name;
  }
}

}  // namespace
}  // namespace stipple
