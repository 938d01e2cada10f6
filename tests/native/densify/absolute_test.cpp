#include "densify/strategies/absolute.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/parallel.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

constexpr float kSmall = 0.0009f;  ///< the switch is 0.001 of the extent of 1
constexpr float kLarge = 0.0011f;

/// One view, then the edit of iteration 600.
std::optional<SplatEdit> firstEdit(const std::vector<Kind>& kinds, const Seen& seen,
                                   const char* name = "absolute") {
  const auto strategy = makeStrategy(name);
  strategy->observe(at(1), seen.statistics());
  return editAt(*strategy, at(600), splatsOf(kinds));
}

TEST(Absolute, SplitsWherePixelsPullAtALargeSplatFromAllSides) {
  // Sums cancel; sizes do not. 3.9e-4 is too little.
  const Seen seen({0, 0}, {4.1e-4f, 3.9e-4f});
  const auto edit = firstEdit({{kLarge, 0.5f}, {kLarge, 0.5f}}, seen);
  ASSERT_TRUE(edit);
  EXPECT_THAT(*edit->keep, ElementsAre(1));
  EXPECT_EQ(edit->append.size(), 2u);
  EXPECT_EQ(firstEdit({{kLarge, 0.5f}, {kLarge, 0.5f}}, seen, "adaptive")->append.size(), 0u);
}

TEST(Absolute, CopiesSmallSplatsBySignedSums) {
  const Seen seen({0, 2.1e-4f, 1.9e-4f}, {1, 2.1e-4f, 1});
  const auto edit = firstEdit(std::vector<Kind>(3, {kSmall, 0.5f}), seen);
  ASSERT_TRUE(edit);
  EXPECT_FALSE(edit->keep);
  ASSERT_EQ(edit->append.size(), 1u);
  EXPECT_EQ(edit->append.positions[0], 1.0f);
}

TEST(Absolute, LengthsAreOfTheSumsAlongEachSide) {
  Seen seen({0, 0}, {0, 0});
  // 100 and 50 pixels are half the sides: 3e-4 and 3e-4 make 4.2e-4, 3e-4 and 2.5e-4 3.9e-4.
  seen.absolute = {3e-6f, 6e-6f, 3e-6f, 5e-6f};
  const auto edit = firstEdit({{kLarge, 0.5f}, {kLarge, 0.5f}}, seen);
  EXPECT_THAT(*edit->keep, ElementsAre(1));
}

TEST(Absolute, AsksForBothStatisticsWhileItLearns) {
  const auto strategy = makeStrategy("absolute");
  const StatisticRequest request = strategy->requests(at(100));
  EXPECT_TRUE(request.screen_gradients);
  EXPECT_TRUE(request.absolute_screen_gradients);
  EXPECT_FALSE(request.contributions || request.blending_weights);
  EXPECT_FALSE(strategy->requests(at(15000)).any());
}

TEST(Absolute, LimitsOpacitiesSoftlyAndHard) {
  const auto strategy = makeStrategy("absolute");
  const RawSplats splats = splatsOf({{kSmall, 0.9f}, {kSmall, 0.006f}});
  std::vector<uint64_t> soft, hard;
  for (uint64_t iteration = 100; iteration <= 15000; iteration += 100) {
    const auto edit = editAt(*strategy, at(iteration), splats);
    if (!edit || edit->writes.empty()) continue;
    for (const RowWrite& write : edit->writes) EXPECT_TRUE(write.clear_moments);
    const RawSplats now = after(*edit, splats);
    EXPECT_EQ(now.logits[1], splats.logits[1]);
    // logit(0.8) and logit(0.01).
    if (std::abs(now.logits[0] - 1.386294f) < 1e-5f) soft.push_back(iteration);
    if (std::abs(now.logits[0] + 4.595120f) < 1e-5f) hard.push_back(iteration);
  }
  EXPECT_EQ(soft.size(), 25u);  // 29 multiples of 500 below 15,000, less the four hard ones
  EXPECT_EQ(soft.front(), 500u);
  EXPECT_THAT(hard, ElementsAre(3000, 6000, 9000, 12000));
}

TEST(Absolute, HardInputsChangeNothing) {
  // Nothing pulls; one splat; a splat that no view has seen.
  for (const size_t count : {1u, 5u}) {
    const std::vector<Kind> kinds(count, {kLarge, 0.5f});
    const auto edit = firstEdit(kinds, Seen(std::vector<float>(count, 0.0f)));
    EXPECT_FALSE(edit->keep);
    EXPECT_EQ(edit->append.size(), 0u);
  }
  Seen unseen({1}, {1});
  unseen.visible[0] = 0;
  EXPECT_EQ(firstEdit({{kLarge, 0.5f}}, unseen)->append.size(), 0u);
}

TEST(Absolute, GoesOnFromItsStateInTheMiddleOfAWindow) {
  const std::vector<Kind> kinds(300, {kLarge, 0.5f});
  std::vector<float> pulls(300);
  for (size_t i = 0; i < 300; ++i) pulls[i] = 3e-6f * static_cast<float>(i);
  const auto whole = makeStrategy("absolute"), half = makeStrategy("absolute");
  const Seen first(std::vector<float>(300, 0.0f), pulls);
  const Seen second(std::vector<float>(300, 1e-4f), std::vector<float>(300, 4e-4f));
  whole->observe(at(501), first.statistics());
  half->restore(whole->state());
  EXPECT_TRUE(half->state().at("screen_pull.split_gradient_sums").values ==
              whole->state().at("screen_pull.split_gradient_sums").values);
  std::vector<float> places[2];
  for (const unsigned threads : {1u, 2u}) {
    Strategy& strategy = threads == 1 ? *whole : *half;
    withThreads(threads, [&] {
      strategy.observe(at(502), second.statistics());
      const auto edit = editAt(strategy, at(600), splatsOf(kinds));
      EXPECT_FALSE(edit->keep->empty());
      places[threads - 1] = {edit->append.positions.begin(), edit->append.positions.end()};
    });
  }
  EXPECT_EQ(places[0], places[1]);
  EXPECT_GT(places[0].size(), 300u);
  EXPECT_THAT(messageOf([&] { makeStrategy("adaptive")->restore({}); }), HasSubstr("no 'births'"));
  EXPECT_THAT(messageOf([&] { whole->restore(makeStrategy("adaptive")->state()); }),
              HasSubstr("no 'gradient_sums'"));
}

}  // namespace
}  // namespace stipple
