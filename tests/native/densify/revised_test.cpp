#include "densify/strategies/revised.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/parallel.h"
#include "control_scene.h"
#include "densify/quantities/opacity_forms.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using testing::after;
using testing::at;
using testing::editAt;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Kind;
using testing::messageOf;
using testing::splatsOf;

/// What one view says of errors.
struct Errors {
  std::vector<float> errors;
  std::vector<uint8_t> visible;
  explicit Errors(std::vector<float> values) : errors(std::move(values)) {
    visible.assign(errors.size(), 1);
  }
  ViewStatistics statistics() const {
    ViewStatistics view;
    view.width = 200;
    view.height = 100;
    view.visible = visible;
    view.arrays[static_cast<size_t>(Statistic::kErrors)] = errors;
    return view;
  }
};

void show(Strategy& strategy, const std::vector<float>& errors, uint64_t iteration = 550) {
  const Errors seen(errors);
  strategy.observe(at(iteration), seen.statistics());
}

double opacityOf(float logit) {
  return 1 / (1 + std::exp(-static_cast<double>(logit)));
}

TEST(Revised, AsksForStructureErrorsUntilTheLastEvent) {
  const auto strategy = makeStrategy("revised");
  EXPECT_TRUE(strategy->requests(at(1)).structure_errors);
  EXPECT_TRUE(strategy->requests(at(26999)).structure_errors);
  EXPECT_FALSE(strategy->requests(at(27000)).any());
  EXPECT_EQ(strategy->transmittanceWeight(at(29000)), 0.1);
}

TEST(Revised, JudgesByTheGreatestErrorOfAnyViewNotByTheirSum) {
  const auto strategy = makeStrategy("revised(growth=10)");
  const RawSplats splats = splatsOf({{0.001f, 0.5f}, {0.001f, 0.5f}, {0.001f, 0.5f}});
  // 0.08 twice is not 0.16; 0.1 is the threshold and not above it.
  show(*strategy, {0.08f, 0.11f, 0.1f});
  show(*strategy, {0.08f, 0.02f, 0.1f});
  const auto edit = editAt(*strategy, at(600), splats);
  ASSERT_TRUE(edit);
  EXPECT_FALSE(edit->keep);
  ASSERT_EQ(edit->append.size(), 1u);
  EXPECT_EQ(edit->append.positions[0], 1.0f);
  // The window begins anew.
  EXPECT_EQ(editAt(*strategy, at(700), after(*edit, splats))->append.size(), 0u);
}

TEST(Revised, SplitsLargeSplatsAndCopiesSmallOnes) {
  const auto strategy = makeStrategy("revised(growth=10,decay=0)");
  const RawSplats splats = splatsOf({{0.009f, 0.5f}, {0.011f, 0.5f}});
  show(*strategy, {1, 1});
  const auto edit = editAt(*strategy, at(600), splats);
  EXPECT_THAT(*edit->keep, ElementsAre(0u));
  ASSERT_EQ(edit->append.size(), 3u);
  // Children of a split lie side by side and keep the opacity; the copy does not.
  EXPECT_LT(edit->append.logits[0], splats.logits[0]);
  EXPECT_EQ(edit->append.logits[1], splats.logits[1]);
  EXPECT_EQ(edit->append.logits[2], splats.logits[1]);
}

TEST(Revised, TwoCopiesAreAsOpaqueAsTheirParent) {
  for (const float opacity : {0.02f, 0.3f, 0.75f, 0.999f}) {
    const auto strategy = makeStrategy("revised(growth=10,decay=0)");
    const RawSplats splats = splatsOf({{0.001f, opacity}});
    show(*strategy, {1});
    const RawSplats made = after(*editAt(*strategy, at(600), splats), splats);
    ASSERT_EQ(made.size(), 2u);
    EXPECT_EQ(made.logits[0], made.logits[1]);
    // 1 - (1 - o')^2 = o. Logits of float32 are off by 2^-24 of 7 at most, opacities by 1e-6.
    const double each = opacityOf(made.logits[0]);
    EXPECT_NEAR(1 - (1 - each) * (1 - each), opacity, 2e-6);
  }
}

TEST(Revised, AddsFivePercentPerEventTheGreatestErrorsFirst) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf(std::vector<Kind>(100, {0.001f, 0.5f}));
  std::vector<float> errors(100);
  for (size_t i = 0; i < 100; ++i) errors[i] = 1.0f + 0.01f * static_cast<float>((i * 37) % 100);
  show(*strategy, errors);
  const auto edit = editAt(*strategy, at(600), splats);
  EXPECT_EQ(edit->countAfter(100), 105u);
  for (size_t k = 0; k < 5; ++k) {
    const size_t row = static_cast<size_t>(edit->append.positions[k * 3]);
    EXPECT_GE((row * 37) % 100, 95u);
  }
}

TEST(Revised, AnEventOfAShortFitStandsForTheOnesThatItLeavesOut) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf(std::vector<Kind>(100, {0.001f, 0.5f}));
  // 3,000 iterations have an event every 100 instead of every 10: 1.05^10 = 1.6289.
  FitMoment moment = at(200);
  moment.iterations = 3000;
  const Errors seen(std::vector<float>(100, 1.0f));
  strategy->observe(moment, seen.statistics());
  EXPECT_EQ(editAt(*strategy, moment, splats)->countAfter(100), 162u);
}

TEST(Revised, OneSplatGrowsAndTheCapHolds) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf({{0.001f, 0.5f}});
  show(*strategy, {1});
  EXPECT_EQ(editAt(*strategy, at(600), splats)->countAfter(1), 2u);
  show(*strategy, {1, 1}, 650);
  const RawSplats two = splatsOf({{0.001f, 0.5f}, {0.001f, 0.5f}});
  EXPECT_EQ(editAt(*strategy, at(700, 2), two)->countAfter(2), 2u);
}

TEST(Revised, EveryOpacityFallsByAThousandthPerEventAndNeverBelowTheLeast) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf({{0.001f, 0.5f}, {0.001f, 0.0061f}, {0.001f, 0.9999f}});
  show(*strategy, {0, 0, 0});
  const RawSplats made = after(*editAt(*strategy, at(600), splats), splats);
  ASSERT_EQ(made.size(), 3u);
  EXPECT_NEAR(opacityOf(made.logits[0]), 0.499, 1e-6);
  EXPECT_NEAR(opacityOf(made.logits[1]), 0.0051, 1e-7);
  // Near 1 as well: 1 - o' = 0.0011 to a part in 1e4, which float32 logits of 0.9999 allow.
  EXPECT_NEAR(1 - opacityOf(made.logits[2]), 0.0011, 1e-7);
  // At the next one the second goes.
  show(*strategy, {0, 0, 0}, 650);
  const RawSplats next = after(*editAt(*strategy, at(700), made), made);
  EXPECT_EQ(next.size(), 3u);
  show(*strategy, {0, 0, 0}, 750);
  EXPECT_EQ(after(*editAt(*strategy, at(800), next), next).size(), 2u);
  RawSplats least = splatsOf({{0.001f, 0.5f}});
  least.logits[0] = -80;
  SplatEdit edit;
  const FitMoment moment = at(600);
  makeOpacityDecay(0.001)->lowerOpacities(controlMoment(moment, EventSchedule{}), least, edit);
  EXPECT_EQ(edit.writes[0].values[0], rawOpacity(kLeastRawOpacity));
}

TEST(Revised, NothingIsResetBetweenEvents) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf({{0.001f, 0.5f}});
  EXPECT_FALSE(editAt(*strategy, at(3050), splats));
}

TEST(Revised, ErrorsOfZeroAndAllAlikeAreNoTrouble) {
  const auto strategy = makeStrategy("revised");
  const RawSplats splats = splatsOf(std::vector<Kind>(40, {0.001f, 0.5f}));
  show(*strategy, std::vector<float>(40, 0.0f));
  EXPECT_EQ(editAt(*strategy, at(600), splats)->countAfter(40), 40u);
  show(*strategy, std::vector<float>(40, 0.5f), 650);
  const auto edit = editAt(*strategy, at(700), splats);
  EXPECT_EQ(edit->countAfter(40), 42u);
  EXPECT_EQ(edit->append.positions[0], 0.0f);  // ties go to the first
}

TEST(Revised, GoesOnFromItsStateAndRefusesOthers) {
  const RawSplats splats = splatsOf({{0.001f, 0.5f}, {0.001f, 0.5f}});
  const auto first = makeStrategy("revised"), second = makeStrategy("revised");
  show(*first, {0.2f, 0.05f});
  second->restore(first->state());
  EXPECT_EQ(editAt(*first, at(600), splats)->append.positions,
            editAt(*second, at(600), splats)->append.positions);
  EXPECT_THAT(messageOf([&] { second->restore({}); }), HasSubstr("has no"));
  TensorTable broken = makeStrategy("revised")->state();
  broken["error_peaks.peaks"] = {{1}, std::vector<float>{-1}};
  EXPECT_THAT(messageOf([&] { second->restore(broken); }), HasSubstr("among peaks"));
}

TEST(Revised, GivesTheSameForAnyThreads) {
  const RawSplats splats = splatsOf(std::vector<Kind>(50000, {0.02f, 0.5f}));
  std::vector<float> errors(50000);
  for (size_t i = 0; i < errors.size(); ++i)
    errors[i] = static_cast<float>((i * 7919) % 997) * 1e-3f;
  RawSplats made[2];
  for (unsigned threads = 1; threads <= 2; ++threads) {
    withThreads(threads, [&] {
      const auto strategy = makeStrategy("revised");
      show(*strategy, errors);
      made[threads - 1] = editAt(*strategy, at(600), splats)->append;
    });
  }
  EXPECT_EQ(made[0].positions, made[1].positions);
  EXPECT_EQ(made[0].logits, made[1].logits);
}

}  // namespace
}  // namespace stipple
