#include "densify/parts/multi_step_update.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using namespace stipple::testing;

/// Iterations (begin, end] with a step.
std::vector<uint64_t> stepsOf(uint64_t begin, uint64_t end, uint64_t iterations) {
  const auto strategy = makeStrategy("adaptive+multi_step_update");
  std::vector<uint64_t> steps;
  for (uint64_t iteration = begin + 1; iteration <= end; ++iteration) {
    FitMoment moment = at(iteration);
    moment.iterations = iterations;
    if (strategy->stepGate(moment)) steps.push_back(iteration);
  }
  return steps;
}

TEST(MultiStepUpdate, TakesThePublishedNumberOfSteps) {
  EXPECT_EQ(stepsOf(0, 30000, 30000).size(), 16874u);
  EXPECT_EQ(stepsOf(0, 15000, 30000).size(), 15000u);
  EXPECT_THAT(stepsOf(15000, 15012, 30000), ElementsAre(15005, 15010));
  EXPECT_THAT(stepsOf(22480, 22545, 30000), ElementsAre(22485, 22490, 22495, 22500, 22520, 22540));
  EXPECT_THAT(stepsOf(29950, 30000, 30000), ElementsAre(29960, 29980));
}

TEST(MultiStepUpdate, ScalesWithTheLengthOfAFit) {
  // A step for one view and then for two, and none for the last iteration.
  EXPECT_EQ(stepsOf(0, 2250, 3000).size(), 2250u);
  EXPECT_EQ(stepsOf(2250, 3000, 3000).size(), 374u);
  EXPECT_EQ(stepsOf(0, 500, 500).size(), 500u);
  EXPECT_EQ(stepsOf(0, 60000, 60000).size(), 30000u + 1500u + 374u);
}

TEST(MultiStepUpdate, EveryIterationStepsWithoutIt) {
  EXPECT_TRUE(makeStrategy("adaptive")->stepGate(at(22501)));
}

}  // namespace
}  // namespace stipple
