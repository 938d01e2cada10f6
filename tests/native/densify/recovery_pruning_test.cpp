#include "densify/parts/recovery_pruning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "base/parallel.h"
#include "densify/control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace stipple::testing;

/// Iterations in which it acts, of a fit of this length.
std::vector<uint64_t> timesOf(uint64_t iterations) {
  const auto part = makeRecoveryPruning();
  std::vector<uint64_t> times;
  for (uint64_t iteration = 1; iteration <= iterations; ++iteration) {
    FitMoment moment = at(iteration);
    moment.iterations = iterations;
    if (part->removesAt(controlMoment(moment, {}))) times.push_back(iteration);
  }
  return times;
}

/// Which of splats with these logits go.
std::vector<uint32_t> goingOf(const std::vector<float>& logits, uint64_t seed = 7) {
  RawSplats splats = splatsOf(std::vector<Kind>(logits.size(), {0.01f, 0.5f}));
  splats.logits.assign(logits.begin(), logits.end());
  FitMoment moment = at(3300);
  moment.seed = seed;
  std::vector<uint8_t> goes(logits.size(), 0);
  makeRecoveryPruning()->remove(controlMoment(moment, {}), splats, rowsOf(splats, {}), goes, {});
  std::vector<uint32_t> rows;
  for (uint32_t i = 0; i < goes.size(); ++i) {
    if (goes[i]) rows.push_back(i);
  }
  return rows;
}

TEST(RecoveryPruning, ActsAWhileAfterTheFirstResets) {
  EXPECT_THAT(timesOf(30000), ElementsAre(3300, 6300));
  EXPECT_THAT(timesOf(60000), ElementsAre(6600, 12600));
  // Opacities need 100 steps to come back; without resets there is nothing to come back from.
  EXPECT_THAT(timesOf(3000), ElementsAre(400, 700));
  EXPECT_THAT(timesOf(2000), ElementsAre());
}

TEST(RecoveryPruning, TheFaintestFifthGoes) {
  EXPECT_THAT(goingOf({3, -1, 2, -2, 0, 1, 4, 5, 6, 7}), ElementsAre(1, 3));
  EXPECT_THAT(goingOf({3, -1, 2, -2, 0, 1, 4, 5, 6}), ElementsAre(3));  // floor(1.8)
  EXPECT_THAT(goingOf({3, -1, 2, 4}), ElementsAre());
  EXPECT_THAT(goingOf({3}), ElementsAre());
  EXPECT_THAT(goingOf({}), ElementsAre());
}

TEST(RecoveryPruning, AnExactNumberOfEqualsGoesFromEverywhere) {
  const std::vector<uint32_t> going = goingOf(std::vector<float>(10000, -2.944f));
  ASSERT_EQ(going.size(), 2000u);
  // Rows lie in the order of the scene. The mean of a random choice: four standard errors are
  // 4 * 10000 / sqrt(12 * 2000).
  const double mean = std::accumulate(going.begin(), going.end(), 0.0) / 2000;
  EXPECT_NEAR(mean, 5000, 260);
  EXPECT_EQ(going, goingOf(std::vector<float>(10000, -2.944f)));
  EXPECT_NE(going, goingOf(std::vector<float>(10000, -2.944f), 8));
}

TEST(RecoveryPruning, CountsWhatIsThereAfterTheEventOfTheSameIteration) {
  const auto strategy = makeStrategy("adaptive+recovery_pruning(share=0.5)");
  std::vector<Kind> kinds(8, {0.005f, 0.5f});
  kinds[0].opacity = 0.001f;  // goes anyway
  kinds[1].opacity = 0.1f;
  kinds[2].opacity = 0.2f;
  kinds[3].opacity = 0.3f;
  strategy->observe(at(3201), Seen({0, 1, 0, 0, 0, 0, 0, 0}).statistics());
  // Seven stay and one is added, as faint as its parent: half of eight are those and two more.
  const auto edit = editAt(*strategy, at(3300), splatsOf(kinds));
  EXPECT_THAT(*edit->keep, ElementsAre(4, 5, 6, 7));
  EXPECT_EQ(edit->append.size(), 0u);
}

TEST(RecoveryPruning, ActsBetweenEventsToo) {
  const auto strategy = makeStrategy("adaptive+recovery_pruning");
  FitMoment moment = at(6660);
  moment.iterations = 66600 / 2;  // resets every 3330: 3663 and 6993
  const RawSplats splats = splatsOf(std::vector<Kind>(10, {0.005f, 0.5f}));
  for (const auto& [iteration, count] : {std::pair{3662u, 10u}, {3663u, 8u}, {3664u, 10u}}) {
    moment.iteration = iteration;
    const auto edit = editAt(*strategy, moment, splats);
    EXPECT_EQ(edit ? edit->countAfter(10) : 10, count) << iteration;
  }
}

TEST(RecoveryPruning, NeedsResets) {
  ControlAssembly assembly;
  addPart(assembly, makeRecoveryPruning());
  EXPECT_EQ(messageOf([&] { makeDensityControl("own", std::move(assembly)); }),
            "recovery_pruning does not go with own: nothing there decides when opacities are "
            "lowered");
}

}  // namespace
}  // namespace stipple
