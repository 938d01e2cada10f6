#include "densify/parts/growth_control.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::HasSubstr;
using namespace stipple::testing;

uint64_t limitAt(uint64_t iteration, uint64_t max_splats, const GrowthControlOptions& options = {},
                 uint64_t iterations = 30000) {
  FitMoment moment = at(iteration, max_splats);
  moment.iterations = iterations;
  return makeGrowthControl(options)->limit(controlMoment(moment, {}), 1000);
}

TEST(GrowthControl, FollowsThePublishedCurve) {
  const std::pair<uint64_t, uint64_t> published[] = {
      {600, 253546},    {1000, 566946},   {3000, 1267731},  {6400, 1947525},
      {10000, 2471263}, {14500, 3000000}, {14900, 3000000},
  };
  for (const auto& [iteration, count] : published) {
    EXPECT_EQ(limitAt(iteration, 3000000), count) << iteration;
    EXPECT_EQ(limitAt(iteration / 10, 3000000, {}, 3000), count) << iteration;
  }
  uint64_t before = 0;
  for (uint64_t iteration = 1; iteration <= 30000; iteration += 7) {
    EXPECT_GE(limitAt(iteration, 3000000), before);
    before = limitAt(iteration, 3000000);
  }
  EXPECT_EQ(limitAt(500, 3000000), 0u);
}

TEST(GrowthControl, EndsAtTheSmallerLimit) {
  EXPECT_EQ(limitAt(15000, 0), 1000000u);
  EXPECT_EQ(limitAt(15000, 0, {.splats = 70}), 70u);
  EXPECT_EQ(limitAt(15000, 60, {.splats = 70}), 60u);
  EXPECT_EQ(limitAt(15000, 80, {.splats = 70}), 70u);
}

TEST(GrowthControl, HoldsAStrategyToTheCurve) {
  const auto strategy = makeStrategy("adaptive+growth_control(splats=240)");
  const std::vector<Kind> kinds(15, {0.005f, 0.5f});
  strategy->observe(at(1), Seen(std::vector<float>(15, 1)).statistics());
  // 240 sqrt(100 / 14000) = 20.28.
  EXPECT_EQ(editAt(*strategy, at(600), splatsOf(kinds))->countAfter(15), 20u);
  // A cloud that begins with more waits.
  const std::vector<Kind> many(30, {0.005f, 0.5f});
  const auto waiting = makeStrategy("adaptive+growth_control(splats=240)");
  waiting->observe(at(1), Seen(std::vector<float>(30, 1)).statistics());
  const auto edit = editAt(*waiting, at(600), splatsOf(many));
  EXPECT_EQ(edit->countAfter(30), 30u);
  EXPECT_FALSE(edit->keep);
}

}  // namespace
}  // namespace stipple
