#include "densify/parts/splat_dropout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/parallel.h"
#include "control_scene.h"
#include "densify/strategies.h"

namespace stipple {
namespace {

using testing::at;
using ::testing::HasSubstr;
using testing::messageOf;

constexpr size_t kCount = 100000;

std::vector<float> factorsAt(uint64_t iteration, const std::string& part = "splat_dropout",
                             uint64_t seed = 7) {
  FitMoment moment = at(iteration);
  moment.seed = seed;
  return makeStrategy("adaptive+" + part)->opacityFactors(moment, kCount);
}

double shareOf(const std::vector<float>& factors) {
  return static_cast<double>(std::count(factors.begin(), factors.end(), 0.0f)) /
         static_cast<double>(factors.size());
}

TEST(SplatDropout, LeavesOutAShareThatGrowsAndKeepsTheMeanOpacity) {
  for (const uint64_t iteration : {3000u, 15000u, 30000u}) {
    const std::vector<float> factors = factorsAt(iteration);
    const double expected = 0.4 * static_cast<double>(iteration) / 30000;
    // Of a binomial share the standard deviation is below 0.0016; four of them.
    EXPECT_NEAR(shareOf(factors), expected, 0.0065) << iteration;
    const float kept = *std::max_element(factors.begin(), factors.end());
    EXPECT_FLOAT_EQ(kept, static_cast<float>(1 / (1 - expected))) << iteration;
  }
  EXPECT_NEAR(shareOf(factorsAt(30000, "splat_dropout(rate=0.5)")), 0.5, 0.007);
  EXPECT_TRUE(factorsAt(0).empty());
  EXPECT_TRUE(factorsAt(30000, "splat_dropout(rate=0)").empty());
  EXPECT_TRUE(makeStrategy("adaptive")->opacityFactors(at(30000), kCount).empty());
}

TEST(SplatDropout, LeavesOutFewerWhereViewsAreMany) {
  const auto shareWith = [](uint64_t views, const std::string& part) {
    FitMoment moment = at(30000);
    moment.view_count = views;
    return shareOf(makeStrategy("adaptive+" + part)->opacityFactors(moment, kCount));
  };
  EXPECT_NEAR(shareWith(8, "splat_dropout"), 0.4, 0.0065);
  EXPECT_NEAR(shareWith(25, "splat_dropout"), 0.2, 0.0055);
  EXPECT_NEAR(shareWith(100, "splat_dropout"), 0.05, 0.003);
  EXPECT_NEAR(shareWith(100, "splat_dropout(views=30)"), 0.3, 0.006);
  EXPECT_NEAR(shareWith(100, "splat_dropout(views=1000,rate=0.2)"), 0.2, 0.0055);
}

TEST(SplatDropout, LeavesOutOthersInEveryIterationAndTheSameForTheSameSeed) {
  const std::vector<float> first = factorsAt(30000);
  EXPECT_EQ(factorsAt(30000), first);
  const auto alike = [&](const std::vector<float>& other) {
    size_t both = 0;
    for (size_t i = 0; i < kCount; ++i) both += first[i] == 0 && other[i] == 0 ? 1 : 0;
    return static_cast<double>(both) / kCount;
  };
  // 0.4 of the 0.4, if they know nothing of each other.
  EXPECT_NEAR(alike(factorsAt(29999)), 0.16, 0.005);
  EXPECT_NEAR(alike(factorsAt(30000, "splat_dropout", 8)), 0.16, 0.005);
  withThreads(1, [&] { EXPECT_EQ(factorsAt(30000), first); });
}

TEST(SplatDropout, GoesWithEveryStrategy) {
  for (const std::string& name : strategyNames()) {
    EXPECT_NO_THROW(makeStrategy(name + "+splat_dropout+multi_step_update")) << name;
  }
  EXPECT_THAT(messageOf([] { makeStrategy("adaptive+splat_dropout(rate=1)"); }),
              HasSubstr("splat_dropout.rate is 1.000000; 0.000000 to 0.900000 is allowed"));
}

}  // namespace
}  // namespace stipple
