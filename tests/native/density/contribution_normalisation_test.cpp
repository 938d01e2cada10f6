#include "density/contribution_normalisation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace stipple {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;

TEST(ContributionNormalisation, DoesItsThreeStepsInOrder) {
  // Harm becomes 0; of 1..10 the 90th percentile is 9.1; the mean of what is left is -54.1 / 12.
  std::vector<double> g = {5, 0};
  for (int i = 1; i <= 10; ++i) g.push_back(-i);
  normaliseContributions({}, g);
  const double mean = -(45 + 9.1) / 12;
  EXPECT_NEAR(g[0], -mean, 1e-12);
  EXPECT_NEAR(g[1], -mean, 1e-12);
  EXPECT_NEAR(g[2], -1 - mean, 1e-12);
  EXPECT_NEAR(g[11], -9.1 - mean, 1e-12);
}

TEST(ContributionNormalisation, EveryStepIsAnOption) {
  const std::vector<double> start = {3, -1, 0, -20};
  std::vector<double> g = start;
  normaliseContributions({false, false, false}, g);
  EXPECT_EQ(g, start);
  g = start;
  normaliseContributions({true, false, false}, g);
  EXPECT_THAT(g, ElementsAre(0, -1, 0, -20));
  g = start;
  normaliseContributions({false, true, false}, g);
  // Sizes 1, 3, 20: 3 + 0.8 * 17.
  EXPECT_THAT(g, ElementsAre(3, -1, 0, DoubleEq(-16.6)));
  g = start;
  normaliseContributions({false, false, true}, g);
  EXPECT_THAT(g, ElementsAre(7.5, 3.5, 4.5, -15.5));
}

TEST(ContributionNormalisation, TakesNothingAndZeros) {
  std::vector<double> none;
  normaliseContributions({}, none);
  std::vector<double> zeros(5, 0.0);
  normaliseContributions({}, zeros);
  EXPECT_EQ(zeros, std::vector<double>(5, 0.0));
  std::vector<double> one = {-4};
  normaliseContributions({true, true, false}, one);
  EXPECT_EQ(one[0], -4);
}

}  // namespace
}  // namespace stipple
