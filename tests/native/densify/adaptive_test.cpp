#include "densify/strategies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "densify/control_scene.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

/// One view, then the edit of iteration 600.
std::optional<SplatEdit> firstEdit(const std::vector<Kind>& kinds,
                                   const std::vector<float>& gradients, uint64_t max_splats = 0) {
  const auto strategy = makeStrategy("adaptive");
  strategy->observe(at(1), Seen(gradients).statistics());
  return editAt(*strategy, at(600, max_splats), splatsOf(kinds));
}

TEST(Adaptive, CopiesSmallSplatsThatArePulledAt) {
  const auto edit = firstEdit({{0.005f, 0.5f}, {0.005f, 0.5f}}, {1.9e-4f, 2.1e-4f});
  ASSERT_TRUE(edit);
  EXPECT_FALSE(edit->keep);
  const RawSplats before = splatsOf({{0.005f, 0.5f}, {0.005f, 0.5f}});
  const RawSplats now = after(*edit, before);
  ASSERT_EQ(now.size(), 3u);
  EXPECT_EQ(now.positions[6], before.positions[3]);
  EXPECT_EQ(now.log_scales[6], before.log_scales[3]);
  EXPECT_EQ(now.logits[2], before.logits[1]);
  EXPECT_EQ(now.sh[24 + 5], before.sh[12 + 5]);
}

TEST(Adaptive, SplitsLargeSplatsIntoTwoOfTheirDistribution) {
  const auto edit = firstEdit({{0.05f, 0.5f}, {0.005f, 0.5f}}, {1e-3f, 0});
  ASSERT_TRUE(edit);
  ASSERT_TRUE(edit->keep);
  EXPECT_THAT(*edit->keep, ElementsAre(1));
  const RawSplats now = after(*edit, splatsOf({{0.05f, 0.5f}, {0.005f, 0.5f}}));
  ASSERT_EQ(now.size(), 3u);
  for (const size_t child : {1u, 2u}) {
    // ln(0.05) - ln(1.6), rounded to float32 twice.
    EXPECT_NEAR(now.log_scales[child * 3], -2.9957323f - 0.4700036f, 5e-7f);
    EXPECT_NEAR(now.logits[child], 0, 1e-6f);
    EXPECT_EQ(now.sh[child * 12 + 3], 3.0f);
    EXPECT_LT(std::abs(now.positions[child * 3]), 0.05f * 6);
  }
  EXPECT_NE(now.positions[3], now.positions[6]);
}

TEST(Adaptive, ChildrenAreSpreadAsTheirParentsAre) {
  // Turned by 90 degrees about z: the parent's long first axis points along y.
  SplatCloud cloud;
  cloud.resize(1);
  const float half = std::sqrt(0.5f);
  const float values[] = {half, 0, 0, half};
  std::copy_n(values, 4, cloud.rotations.begin());
  cloud.scales = {0.09f, 0.03f, 0.01f};
  cloud.opacities = {0.5f};
  RawSplats parents = rowsOf(rawSplats(cloud), std::vector<uint32_t>(4000, 0));
  const auto strategy = makeStrategy("adaptive");
  strategy->observe(at(1), Seen(std::vector<float>(4000, 1)).statistics());
  const RawSplats children = after(*editAt(*strategy, at(600), parents), parents);
  ASSERT_EQ(children.size(), 8000u);
  const double expected[] = {0.03, 0.09, 0.01};
  for (size_t axis = 0; axis < 3; ++axis) {
    double sum = 0, squares = 0;
    for (size_t i = 0; i < 8000; ++i) {
      const double x = static_cast<double>(children.positions[i * 3 + axis]);
      sum += x;
      squares += x * x;
    }
    // Four standard errors of 8000 samples: 4/sqrt(8000) and 4/sqrt(16000).
    EXPECT_NEAR(sum / 8000, 0, 0.045 * expected[axis]);
    EXPECT_NEAR(std::sqrt(squares / 8000), expected[axis], 0.032 * expected[axis]);
  }
}

TEST(Adaptive, AveragesOverTheViewsThatSeeASplat) {
  const auto strategy = makeStrategy("adaptive");
  Seen seen({3e-4f, 3e-4f});
  strategy->observe(at(1), seen.statistics());
  Seen other({0, 0});
  other.visible[1] = 0;
  strategy->observe(at(2), other.statistics());
  const RawSplats splats = splatsOf({{0.005f, 0.5f}, {0.005f, 0.5f}});
  // (3e-4 + 0) / 2 is too little, 3e-4 / 1 is enough.
  const auto edit = editAt(*strategy, at(600), splats);
  ASSERT_TRUE(edit);
  ASSERT_EQ(edit->append.size(), 1u);
  EXPECT_EQ(edit->append.positions[0], 1.0f);
  // And forgets them.
  EXPECT_EQ(editAt(*strategy, at(700), after(*edit, splats))->append.size(), 0u);
}

TEST(Adaptive, GradientsCountPerHalfPictureAlongBothSides) {
  const auto strategy = makeStrategy("adaptive");
  Seen seen({0, 0});
  // 100 and 50 pixels are half the sides: 1.2e-4 and 1.7e-4 make 2.08e-4, 1e-4 and 1.7e-4 1.97e-4.
  seen.gradients = {1.2e-6f, 3.4e-6f, 1e-6f, 3.4e-6f};
  strategy->observe(at(1), seen.statistics());
  const auto edit = editAt(*strategy, at(600), splatsOf({{0.005f, 0.5f}, {0.005f, 0.5f}}));
  ASSERT_EQ(edit->append.size(), 1u);
  EXPECT_EQ(edit->append.positions[0], 0.0f);
}

TEST(Adaptive, RemovesFaintSplatsAndLaterHugeOnes) {
  const std::vector<Kind> kinds = {
      {0.005f, 0.0049f}, {0.2f, 0.5f}, {0.005f, 0.0051f}, {0.005f, 0.5f}};
  const auto strategy = makeStrategy("adaptive");
  EXPECT_THAT(*editAt(*strategy, at(600), splatsOf(kinds))->keep, ElementsAre(1, 2, 3));
  const auto later = makeStrategy("adaptive");
  EXPECT_THAT(*editAt(*later, at(3100), splatsOf(kinds))->keep, ElementsAre(2, 3));
}

TEST(Adaptive, WhatIsFarFromTheCamerasMayBeLarge) {
  // At 0, 1 ... 4 m, of cameras that are spread over one metre: a tenth of the distance or of that
  // metre, whichever is more.
  const std::vector<Kind> kinds = {
      {0.2f, 0.5f}, {0.101f, 0.5f}, {0.199f, 0.5f}, {0.31f, 0.5f}, {0.399f, 0.5f}};
  const auto strategy = makeStrategy("adaptive");
  EXPECT_THAT(*editAt(*strategy, at(3100), splatsOf(kinds))->keep, ElementsAre(2, 4));
  FitMoment moment = at(3100);
  moment.centre.x() = 4;
  const auto other = makeStrategy("adaptive");
  EXPECT_THAT(*editAt(*other, moment, splatsOf(kinds))->keep, ElementsAre(0, 1, 2));
}

TEST(Adaptive, AHugeSplatLivesOnInChildrenThatAreNot) {
  const std::vector<Kind> kinds = {{0.15f, 0.5f}, {0.17f, 0.5f}, {0.005f, 0.5f}};
  const auto strategy = makeStrategy("adaptive");
  strategy->observe(at(3001), Seen({1, 1, 0}).statistics());
  // 0.15 / 1.6 is below 0.1, 0.17 / 1.6 is not.
  const auto edit = editAt(*strategy, at(3100), splatsOf(kinds));
  EXPECT_THAT(*edit->keep, ElementsAre(2));
  EXPECT_EQ(edit->append.size(), 2u);
}

TEST(Adaptive, TheStrongestPullsWinWhereThereIsNoRoom) {
  const std::vector<Kind> kinds(5, {0.005f, 0.5f});
  auto edit = firstEdit(kinds, {3e-4f, 9e-4f, 5e-4f, 7e-4f, 4e-4f}, 7);
  ASSERT_EQ(edit->append.size(), 2u);
  const std::set<float> places = {edit->append.positions[0], edit->append.positions[3]};
  EXPECT_THAT(places, ElementsAre(1.0f, 3.0f));
  // Tied: the first ones.
  edit = firstEdit(kinds, {5e-4f, 5e-4f, 5e-4f, 5e-4f, 5e-4f}, 8);
  ASSERT_EQ(edit->append.size(), 3u);
  EXPECT_EQ(edit->append.positions[0] + edit->append.positions[3] + edit->append.positions[6], 3);
  // Full already.
  edit = firstEdit(kinds, {1, 1, 1, 1, 1}, 3);
  EXPECT_EQ(edit->countAfter(5), 5u);
  EXPECT_FALSE(edit->keep);
}

TEST(Adaptive, TellsBeforehandWhenItLowersOpacities) {
  const auto strategy = makeStrategy("adaptive");
  const RawSplats splats = splatsOf({{0.005f, 0.9f}});
  for (const uint64_t iteration : {600u, 2999u, 3000u, 3001u, 3100u, 12000u, 15000u, 18000u}) {
    const auto edit = editAt(*strategy, at(iteration), splats);
    const bool lowers = edit && !edit->writes.empty();
    EXPECT_EQ(strategy->lowersOpacitiesAt(at(iteration)), lowers) << iteration;
  }
  EXPECT_TRUE(strategy->lowersOpacitiesAt(at(3000)));
  EXPECT_FALSE(makeStrategy("mcmc")->lowersOpacitiesAt(at(3000)));
  // From 0.01 to a half by steps of 0.05 of the logit: 91.9 of them. A limit of 0.8 hides nothing.
  EXPECT_EQ(strategy->foggyStepsAfter(at(3000)), 92u);
  EXPECT_EQ(strategy->foggyStepsAfter(at(3001)), 0u);
  EXPECT_EQ(makeStrategy("mcmc")->foggyStepsAfter(at(3000)), 0u);
  EXPECT_TRUE(makeStrategy("direction")->lowersOpacitiesAt(at(3500)));
  EXPECT_EQ(makeStrategy("direction")->foggyStepsAfter(at(3500)), 0u);
}

TEST(Adaptive, WhatIsRemovedMakesRoom) {
  const std::vector<Kind> kinds = {{0.005f, 0.001f}, {0.005f, 0.001f}, {0.05f, 0.5f}};
  const auto edit = firstEdit(kinds, {1, 1, 1}, 2);
  EXPECT_TRUE(edit->keep->empty());
  EXPECT_EQ(edit->append.size(), 2u);
}

TEST(Adaptive, RefusesSplatsThatItsStatisticsAreNotOf) {
  for (const char* name : {"adaptive", "absolute"}) {
    const auto strategy = makeStrategy(name);
    Seen seen({1e-3f, 1e-3f});
    strategy->observe(at(1), seen.statistics());
    for (const size_t other : {1u, 3u}) {  // as after an edit that nobody made
      const RawSplats splats = splatsOf(std::vector<Kind>(other, {0.005f, 0.5f}));
      EXPECT_THROW(editAt(*strategy, at(600), splats), Error) << name << other;
    }
  }
}

TEST(Adaptive, LeavesSplatsAloneThatNothingPullsAt) {
  const auto edit = firstEdit({{0.005f, 0.5f}, {0.05f, 0.5f}}, {0, 0});
  ASSERT_TRUE(edit);
  EXPECT_FALSE(edit->keep);
  EXPECT_EQ(edit->append.size(), 0u);
  // Of a splat that no view has seen, the average is 0, not 0 / 0.
  const auto strategy = makeStrategy("adaptive");
  EXPECT_EQ(editAt(*strategy, at(600), splatsOf({{0.05f, 0.5f}}))->append.size(), 0u);
}

TEST(Adaptive, TheLastSplatStays) {
  const auto edit = firstEdit({{0.005f, 0.001f}, {0.005f, 0.004f}, {0.005f, 0.002f}}, {1, 1, 1});
  EXPECT_THAT(*edit->keep, ElementsAre(1));
  EXPECT_EQ(edit->append.size(), 0u);
  const auto strategy = makeStrategy("adaptive");
  EXPECT_FALSE(editAt(*strategy, at(600), RawSplats()));
}

TEST(Adaptive, WithoutAnExtentNothingIsLarge) {
  const auto strategy = makeStrategy("adaptive");
  strategy->observe(at(1), Seen({1, 1}).statistics());
  FitMoment moment = at(3100);
  moment.extent = 0;
  const auto edit = editAt(*strategy, moment, splatsOf({{50, 0.5f}, {0.005f, 0.5f}}));
  EXPECT_FALSE(edit->keep);
  EXPECT_EQ(edit->append.size(), 2u);
}

TEST(Adaptive, KeepsThePublishedSchedule) {
  const auto strategy = makeStrategy("adaptive");
  std::vector<uint64_t> edits, resets;
  const RawSplats splats = splatsOf({{0.005f, 0.5f}});
  for (uint64_t iteration = 1; iteration <= 30000; ++iteration) {
    const auto edit = editAt(*strategy, at(iteration), splats);
    if (!edit) continue;
    edits.push_back(iteration);
    if (!edit->writes.empty()) resets.push_back(iteration);
    EXPECT_EQ(strategy->requests(at(iteration)).any(), iteration < 15000);
  }
  EXPECT_EQ(edits.size(), 144u);
  EXPECT_EQ(edits.front(), 600u);
  EXPECT_EQ(edits.back(), 14900u);
  EXPECT_THAT(resets, ElementsAre(3000, 6000, 9000, 12000));
}

TEST(Adaptive, ShortFitsScaleTheScheduleWithinReason) {
  const RawSplats splats = splatsOf({{0.005f, 0.5f}});
  struct Edits {
    uint64_t first = 0, last = 0;
    int count = 0, resets = 0;
  };
  const auto editsOf = [&](uint64_t iterations) {
    const auto strategy = makeStrategy("adaptive");
    Edits edits;
    for (uint64_t iteration = 1; iteration <= iterations; ++iteration) {
      FitMoment moment = at(iteration);
      moment.iterations = iterations;
      const auto edit = editAt(*strategy, moment, splats);
      if (!edit) continue;
      if (edits.count++ == 0) edits.first = iteration;
      edits.last = iteration;
      edits.resets += !edit->writes.empty();
    }
    return edits;
  };
  // Twice the length, twice the interval.
  const Edits twice = editsOf(60000);
  EXPECT_EQ(twice.count, 144);
  EXPECT_EQ(twice.resets, 4);
  EXPECT_EQ(twice.first, 1200u);
  EXPECT_EQ(twice.last, 29800u);
  // Edits need 100 steps between them, resets 300.
  const Edits tenth = editsOf(3000);
  EXPECT_EQ(tenth.count, 14);  // 100, 200, ..., 1400
  EXPECT_EQ(tenth.resets, 4);
  const Edits short_one = editsOf(500);
  EXPECT_EQ(short_one.count, 2);  // 100, 200
  EXPECT_EQ(short_one.resets, 0);
  EXPECT_EQ(scaleSchedule(500, 30), 1u);
  EXPECT_EQ(scaleSchedule(100, 1), 1u);
  EXPECT_EQ(scaleSchedule(15000, 60000), 30000u);
}

TEST(Adaptive, AResetLowersOpacitiesAndForgetsTheirMoments) {
  const auto strategy = makeStrategy("adaptive");
  strategy->observe(at(2990), Seen({1, 0}).statistics());
  RawSplats splats = splatsOf({{0.005f, 0.9f}, {0.005f, 0.006f}});
  const auto edit = editAt(*strategy, at(3000), splats);
  ASSERT_TRUE(edit);
  ASSERT_EQ(edit->writes.size(), 1u);
  EXPECT_TRUE(edit->writes[0].clear_moments);
  const RawSplats now = after(*edit, splats);
  ASSERT_EQ(now.size(), 3u);
  EXPECT_NEAR(now.logits[0], -4.595120f, 1e-5f);
  EXPECT_EQ(now.logits[1], splats.logits[1]);
  EXPECT_NEAR(now.logits[2], -4.595120f, 1e-5f);  // the new one, too
}

TEST(Adaptive, GoesOnFromItsStateBitForBit) {
  const std::vector<Kind> kinds(200, {0.03f, 0.5f});
  std::vector<float> pulls(200);
  for (size_t i = 0; i < 200; ++i) pulls[i] = 2e-6f * static_cast<float>(i);
  const auto first = makeStrategy("adaptive"), second = makeStrategy("adaptive");
  first->observe(at(501), Seen(pulls).statistics());
  second->restore(first->state());
  for (Strategy* strategy : {first.get(), second.get()}) {
    strategy->observe(at(502), Seen(std::vector<float>(200, 2.1e-4f)).statistics());
  }
  const auto a = editAt(*first, at(600), splatsOf(kinds));
  const auto b = editAt(*second, at(600), splatsOf(kinds));
  EXPECT_EQ(*a->keep, *b->keep);
  EXPECT_EQ(a->append.positions, b->append.positions);
  EXPECT_GT(a->append.size(), 100u);
}

TEST(Adaptive, DiceDependOnSeedAndIterationAlone) {
  const std::vector<Kind> kinds(3000, {0.03f, 0.5f});
  const auto placesOf = [&](uint64_t iteration, uint64_t seed, unsigned threads) {
    const auto strategy = makeStrategy("adaptive");
    std::vector<float> places;
    withThreads(threads, [&] {
      strategy->observe(at(1), Seen(std::vector<float>(3000, 1)).statistics());
      FitMoment moment = at(iteration);
      moment.seed = seed;
      const auto edit = editAt(*strategy, moment, splatsOf(kinds));
      places.assign(edit->append.positions.begin(), edit->append.positions.end());
    });
    return places;
  };
  const std::vector<float> places = placesOf(600, 1, 1);
  EXPECT_EQ(places, placesOf(600, 1, 2));
  EXPECT_NE(places, placesOf(700, 1, 2));
  EXPECT_NE(places, placesOf(600, 2, 2));
}

TEST(Adaptive, RefusesTheStateOfAnother) {
  const auto strategy = makeStrategy("adaptive");
  EXPECT_THAT(messageOf([&] { strategy->restore({}); }), HasSubstr("no 'births'"));
  TensorTable table = strategy->state();
  table["screen_pull.visible_counts"] = {{1}, std::vector<uint32_t>{1}};
  EXPECT_THAT(messageOf([&] { strategy->restore(table); }),
              HasSubstr("0 gradient_sums and 1 visible_counts"));
  table["screen_pull.gradient_sums"] = {{1}, std::vector<float>{-1}};
  EXPECT_THAT(messageOf([&] { strategy->restore(table); }), HasSubstr("0 and more is allowed"));
}

TEST(Strategies, AreMadeByName) {
  EXPECT_THAT(strategyNames(), ::testing::Contains("adaptive"));
  for (const std::string& name : strategyNames()) EXPECT_EQ(makeStrategy(name)->name(), name);
  try {
    makeStrategy("adaptve");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_THAT(error.what(), HasSubstr("strategy is 'adaptve'; there is adaptive"));
  }
}

}  // namespace
}  // namespace stipple
