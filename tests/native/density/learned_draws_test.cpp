#include "density/learned_draws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "density/learned_density.h"
#include "math/morton.h"

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

const RootCube kUnit = {{0, 0, 0}, 1.0};

/// Positions and log densities, ascending.
std::vector<std::array<float, 4>> places(const AnchorSet& anchors) {
  std::vector<std::array<float, 4>> all;
  for (size_t i = 0; i < anchors.size(); ++i) {
    const float* p = &anchors.positions[i * 3];
    all.push_back({p[0], p[1], p[2], anchors.log_q[i]});
  }
  std::sort(all.begin(), all.end());
  return all;
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

/// A density that knows nothing below level 3 of 6, and has moved since.
LearnedDensity shallowDensity() {
  LearnedDensity density(kUnit, 6, 3);
  std::vector<float> logits(8);
  for (size_t k = 0; k < 8; ++k) logits[k] = static_cast<float>(k) - 4.0f;
  for (int level = 0; level < 3; ++level) {
    density.setLogits(level, std::vector<uint32_t>{0}, logits);
  }
  return density;
}

TEST(LearnedDraws, AFewActiveCellsBelowTheOthersChangeNothingThatIsKept) {
  LearnedDensity density = shallowDensity();
  const AnchorSet before = drawSettled(density, asked(500, 3), {true, true, 9});
  density.activate({{{3, 0}, 100}, {{3, 1}, 100}}, 8);
  density.activate({{{4, 8}, 100}}, 8);
  density.activate({{{5, 65}, 100}}, 8);
  EXPECT_EQ(density.settledLevel(), 3);
  EXPECT_EQ(density.frozen().leafLevel(), 3);
  EXPECT_EQ(places(drawSettled(density, asked(500, 3), {true, true, 9})), places(before));
  // As a state that is stored.
  const LearnedDensity stored(kUnit, density.levels(), density.settledLevel());
  EXPECT_EQ(places(drawSettled(stored, asked(500, 3), {true, true, 9})), places(before));
  EXPECT_EQ(LearnedDensity(kUnit, density.levels()).settledLevel(), 6);
  for (const int level : {-1, 7}) {
    EXPECT_THROW(LearnedDensity(kUnit, density.levels(), level), Error) << level;
  }
}

TEST(LearnedDraws, SettledOnesAreThoseOfTheFrozenDensity) {
  for (const bool deep : {false, true}) {
    LearnedDensity density = shallowDensity();
    if (deep) {  // all cells below become active, level by level, with even choices
      for (int level = 3; level < 6; ++level) {
        LearnedDensity::DrawCounts draws;
        for (uint64_t cell = 0; cell < uint64_t{1} << (3 * level); ++cell) {
          draws[{level, cell}] = 100;
        }
        density.activate(draws, 8);
      }
    }
    const AnchorSet frozen = drawLearned(density.frozen(), asked(500, 3), {true, true, 9});
    const AnchorSet settled = drawSettled(density, asked(500, 3), {true, true, 9});
    EXPECT_EQ(frozen.leaf_level, deep ? 6 : 3);
    EXPECT_EQ(settled.leaf_level, 6);
    ASSERT_EQ(settled.size(), frozen.size());
    EXPECT_TRUE(std::is_sorted(settled.leaves.begin(), settled.leaves.end()));
    EXPECT_EQ(places(settled), places(frozen));
    for (size_t i = 0; i < settled.size(); ++i) {
      const auto at = mortonDecode(settled.leaves[i]);
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(static_cast<float>(at[axis]), std::floor(settled.positions[i * 3 + axis] * 64));
      }
    }
  }
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
