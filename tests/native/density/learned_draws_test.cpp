#include "density/learned_draws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace stipple {
namespace {

/// Points of a diagonal plane.
OctreeDensity planeDensity() {
  std::vector<float> points;
  for (size_t i = 0; i < 4000; ++i) {
    const auto u = static_cast<float>(unitDouble(mixBits(2 * i)));
    const auto v = static_cast<float>(unitDouble(mixBits(2 * i + 1)));
    points.insert(points.end(), {u, v, 0.5f * (u + v)});
  }
  OctreeDensityOptions options;
  options.leaf_level = 6;
  return OctreeDensity::fromPoints(points, {}, options);
}

AnchorSamplingOptions asked(uint64_t count, uint64_t seed) {
  AnchorSamplingOptions options;
  options.count = count;
  options.seed = seed;
  return options;
}

TEST(LearnedDraws, NestedOnesAreThoseOfTheSumOfSeedsInTheProgressiveOrder) {
  const OctreeDensity density = planeDensity();
  AnchorSamplingOptions wanted = asked(300, 12);
  wanted.order = AnchorOrder::kProgressive;
  const AnchorSet seen = drawLearned(density, asked(300, 3), {true, true, 9});
  EXPECT_EQ(seen.positions, sampleAnchors(density, wanted).positions);
  // A smaller budget is a part of a larger one.
  const AnchorSet more = drawLearned(density, asked(1200, 3), {true, true, 9});
  EXPECT_TRUE(std::includes(more.leaves.begin(), more.leaves.end(), seen.leaves.begin(),
                            seen.leaves.end()));
}

TEST(LearnedDraws, OthersAreAsTheCallerAsks) {
  const OctreeDensity density = planeDensity();
  EXPECT_EQ(drawLearned(density, asked(300, 3), {true, false, 9}).positions,
            sampleAnchors(density, asked(300, 3)).positions);
}

TEST(LearnedDraws, StandInTheMiddleOfTheirLeavesWithoutJitter) {
  const OctreeDensity density = planeDensity();
  const AnchorSet with = drawLearned(density, asked(300, 3), {true, true, 0});
  const AnchorSet without = drawLearned(density, asked(300, 3), {false, true, 0});
  EXPECT_EQ(with.leaves, without.leaves);
  for (size_t i = 0; i < without.positions.size(); ++i) {
    const float in_leaf = without.positions[i] * 64.0f;
    EXPECT_EQ(in_leaf - std::floor(in_leaf), 0.5f);
    // The same leaf: at most half its side away.
    EXPECT_LE(std::abs(with.positions[i] - without.positions[i]), 0.5f / 64.0f);
  }
}

}  // namespace
}  // namespace stipple
