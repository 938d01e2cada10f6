#include "density/learned_density.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "density/density_fixtures.h"

namespace stipple {
namespace {

const RootCube kRoot = {{-0.1, -0.1, -0.1}, 1.2};

LearnedDensity wavyDensity(size_t count, int leaf_level) {
  const TestPoints points = wavyPoints(count, 3);
  return LearnedDensity::fromPoints(points.positions, points.weights, kRoot, leaf_level);
}

/// The same with every logit moved.
LearnedDensity shaken(const LearnedDensity& density, float size) {
  std::vector<LearnedLevel> levels = density.levels();
  uint64_t number = 0;
  for (LearnedLevel& level : levels) {
    for (float& logit : level.logits) {
      logit += size * (unitFloat(keyedBits(9, RandomUse::kFieldStart, number++)) - 0.5f);
    }
  }
  return LearnedDensity(density.root(), std::move(levels));
}

/// log q of a leaf from the stored logits, in double, by the definition.
double logDensity(const std::vector<LearnedLevel>& levels, uint64_t leaf) {
  double sum = 0;
  for (size_t l = 0; l < levels.size(); ++l) {
    const int below = 3 * static_cast<int>(levels.size() - l);
    const uint64_t cell = leaf >> below;
    const size_t k = (leaf >> (below - 3)) & 7;
    const auto at = std::find(levels[l].cells.begin(), levels[l].cells.end(), cell);
    if (at == levels[l].cells.end()) {
      sum -= std::log(8.0);
      continue;
    }
    const size_t row = static_cast<size_t>(at - levels[l].cells.begin());
    double total = 0;
    for (size_t i = 0; i < 8; ++i) {
      total += std::exp(static_cast<double>(levels[l].logits[row * 8 + i]));
    }
    const double share = std::exp(static_cast<double>(levels[l].logits[row * 8 + k])) / total;
    sum += std::log((1 - kUniformShare) * share + kUniformShare / 8);
  }
  return sum;
}

AnchorSet sampled(const DensityModel& model, uint64_t count, uint64_t seed = 5) {
  AnchorSamplingOptions options;
  options.count = count;
  options.seed = seed;
  return sampleAnchors(model, options);
}

TEST(LearnedDensity, StartsEvenAndReachesEverywhere) {
  const LearnedDensity density(kRoot, 4);
  const std::vector<uint64_t> cells = {0, 3, 100, 511};
  std::vector<float> out(8 * cells.size());
  density.childLogProbabilities(3, cells, out);
  for (const float value : out) EXPECT_FLOAT_EQ(value, -std::log(8.0f));
  density.childLogProbabilities(0, std::vector<uint64_t>{0}, std::span(out).first(8));
  for (size_t k = 0; k < 8; ++k) EXPECT_FLOAT_EQ(out[k], -std::log(8.0f));
  // 12 log 2 nats: 4096 even leaves.
  EXPECT_NEAR(density.entropy(), 12 * std::log(2.0), 1e-6);
}

TEST(LearnedDensity, AnchorsCarryTheLogDensityOfTheDefinition) {
  const LearnedDensity density = shaken(wavyDensity(3000, 5), 3.0f);
  const AnchorSet anchors = sampled(density, 2000);
  ASSERT_EQ(anchors.size(), 2000u);
  for (size_t i = 0; i < anchors.size(); ++i) {
    // Five float32 logarithms of up to 10 nats.
    EXPECT_NEAR(static_cast<double>(anchors.log_q[i]),
                logDensity(density.levels(), anchors.leaves[i]), 5e-6);
  }
}

TEST(LearnedDensity, NoChoiceFallsBelowTheEvenShare) {
  std::vector<LearnedLevel> levels(2);
  levels[0] = {{0}, {60, -60, -60, -60, -60, -60, -60, -60}, std::vector<float>(8, 0.0f)};
  const LearnedDensity density(kRoot, levels);
  std::vector<float> out(8);
  density.childLogProbabilities(0, std::vector<uint64_t>{0}, out);
  EXPECT_NEAR(static_cast<double>(out[0]), std::log(1 - kUniformShare * 7 / 8), 1e-6);
  for (size_t k = 1; k < 8; ++k) {
    EXPECT_NEAR(static_cast<double>(out[k]), std::log(kUniformShare / 8), 1e-6);
  }
}

TEST(LearnedDensity, FitsThePointsAtOnce) {
  const LearnedDensity density = wavyDensity(20000, 5);
  DensityGradient gradient;
  const double loss = density.structuralLoss(1.0, &gradient);
  // Only children whose share is below the even share of 1e-3 / 8 are missed.
  EXPECT_GE(loss, -1e-9);
  EXPECT_LT(loss, 1e-3);
  EXPECT_GT(shaken(density, 1.0f).structuralLoss(1.0, nullptr), 0.01);
  for (const DensityGradient::Level& level : gradient.levels) {
    EXPECT_FALSE(level.rows.empty());
    for (const double value : level.values) EXPECT_LT(std::abs(value), 1e-3);
  }
}

TEST(LearnedDensity, StructuralGradientIsThatOfDifferences) {
  const LearnedDensity density = shaken(wavyDensity(300, 3), 2.0f);
  DensityGradient gradient;
  density.structuralLoss(0.7, &gradient);
  size_t compared = 0;
  for (size_t l = 0; l < gradient.levels.size(); ++l) {
    for (size_t i = 0; i < gradient.levels[l].rows.size(); ++i) {
      const size_t row = gradient.levels[l].rows[i];
      const size_t k = (row + l) % 8;
      std::vector<LearnedLevel> levels = density.levels();
      const float kept = levels[l].logits[row * 8 + k];
      const float eps = 0x1.0p-6f;
      levels[l].logits[row * 8 + k] = kept + eps;
      const double high = LearnedDensity(kRoot, levels).structuralLoss(1.0, nullptr);
      levels[l].logits[row * 8 + k] = kept - eps;
      const double low = LearnedDensity(kRoot, levels).structuralLoss(1.0, nullptr);
      // The loss reads float32 logarithms, off by 1e-7 of a few nats each and weighted by at most
      // 1: 1e-7 / eps; the differences' own error is eps^2 / 6.
      EXPECT_NEAR(gradient.levels[l].values[i * 8 + k],
                  0.7 * (high - low) / (2 * static_cast<double>(eps)), 6e-5);
      ++compared;
    }
  }
  EXPECT_GT(compared, 30u);
}

TEST(LearnedDensity, LogGradientIsThatOfDifferences) {
  const LearnedDensity density = shaken(wavyDensity(500, 4), 4.0f);
  const AnchorSet anchors = sampled(density, 200);
  std::vector<double> g(anchors.size());
  for (size_t i = 0; i < g.size(); ++i) {
    g[i] = unitDouble(keyedBits(4, RandomUse::kFieldStart, i)) - 0.6;
  }
  const DensityGradient gradient = density.logDensityGradient(anchors, g);
  const auto surrogate = [&](const std::vector<LearnedLevel>& levels) {
    double sum = 0;
    for (size_t i = 0; i < g.size(); ++i) sum += g[i] * logDensity(levels, anchors.leaves[i]);
    return sum;
  };
  std::vector<LearnedLevel> levels = density.levels();
  double largest = 0;
  for (size_t l = 0; l < levels.size(); ++l) {
    for (size_t i = 0; i < gradient.levels[l].rows.size(); ++i) {
      const size_t at = gradient.levels[l].rows[i] * size_t{8} + (i + l) % 8;
      const float kept = levels[l].logits[at];
      const float eps = 0x1.0p-8f;
      levels[l].logits[at] = kept + eps;
      const double high = surrogate(levels);
      const double above = static_cast<double>(levels[l].logits[at]);
      levels[l].logits[at] = kept - eps;
      const double low = surrogate(levels);
      const double below = static_cast<double>(levels[l].logits[at]);
      levels[l].logits[at] = kept;
      // Truncation of central differences: eps^2 / 6 of third derivatives of at most 200 |g|.
      const double value = gradient.levels[l].values[i * 8 + (i + l) % 8];
      EXPECT_NEAR(value, (high - low) / (above - below), 2e-4);
      largest = std::max(largest, std::abs(value));
    }
  }
  EXPECT_GT(largest, 0.5);
}

/// All pairs of anchors that independent draws can give, each by its probability.
TEST(LearnedDensity, ComparingAnchorsWithTheOthersOfTheirCellKeepsTheMeanGradient) {
  LearnedDensity density(kRoot, 1, 1);
  const std::vector<float> logits = {0.5f, -1.0f, 2.0f, 0.0f, 1.0f, -0.5f, 0.25f, -2.0f};
  density.setLogits(0, std::vector<uint32_t>{0}, logits);
  const double g[8] = {0.3, -2.0, 0.7, 5.0, -0.1, 0.0, 1.5, -0.4};
  std::vector<double> plain(8), compared(8);
  for (uint64_t a = 0; a < 8; ++a) {
    for (uint64_t b = 0; b < 8; ++b) {
      AnchorSet anchors;
      anchors.leaves = {std::min(a, b), std::max(a, b)};
      anchors.log_q.resize(2);
      const std::vector<double> given = {g[anchors.leaves[0]], g[anchors.leaves[1]]};
      const double share = std::exp(logDensity(density.levels(), a)) *
                           std::exp(logDensity(density.levels(), b));
      const auto by_plain = density.logDensityGradient(anchors, given).levels[0].values;
      const auto by_compared =
          density.logDensityGradient(anchors, given, {true, 2}).levels[0].values;
      for (size_t k = 0; k < 8; ++k) {
        plain[k] += share * by_plain[k];
        compared[k] += share * by_compared[k];
      }
    }
  }
  // The probabilities of the density are float32.
  for (size_t k = 0; k < 8; ++k) EXPECT_NEAR(compared[k], plain[k], 1e-6) << k;
}

TEST(LearnedDensity, AnchorsThatAreWorthTheSameMoveNothingWhenTheyAreCompared) {
  const LearnedDensity density = wavyDensity(5000, 6);
  const AnchorSet anchors = sampled(density, 3000);
  const std::vector<double> alike(anchors.size(), 0.7);
  const DensityGradient gradient = density.logDensityGradient(anchors, alike, {true, 4});
  size_t cells = 0;
  for (size_t l = 0; l < gradient.levels.size(); ++l) {
    for (const double value : gradient.levels[l].values) EXPECT_NEAR(value, 0, 1e-9);
    cells += gradient.levels[l].rows.size();
    // Cells of the leaves' level hold fewer anchors than can be compared.
    EXPECT_LT(gradient.levels[l].rows.size(), anchors.size() / 4 + 1);
  }
  EXPECT_GT(cells, 50u);
  double moved = 0;
  for (const auto& level : density.logDensityGradient(anchors, alike).levels) {
    for (const double value : level.values) moved = std::max(moved, std::abs(value));
  }
  EXPECT_GT(moved, 0.1);  // by chance alone
}

TEST(LearnedDensity, GradientsHaveTheSameBitsForAnyNumberOfThreads) {
  const LearnedDensity density = wavyDensity(5000, 6);
  const AnchorSet anchors = sampled(density, 3000);
  std::vector<double> g(anchors.size());
  std::iota(g.begin(), g.end(), -1000.0);
  DensityGradient first;
  withThreads(1, [&] { first = density.logDensityGradient(anchors, g); });
  withThreads(3, [&] {
    const DensityGradient again = density.logDensityGradient(anchors, g);
    for (size_t l = 0; l < first.levels.size(); ++l) {
      EXPECT_EQ(again.levels[l].rows, first.levels[l].rows);
      EXPECT_EQ(again.levels[l].values, first.levels[l].values);
    }
  });
}

TEST(LearnedDensity, ActivatingCellsLeavesTheDensityAsItIs) {
  LearnedDensity density = wavyDensity(400, 4);
  const LearnedDensity before = density;
  LearnedDensity::DrawCounts draws;
  uint64_t counted = 0;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    density.countDraws(sampled(density, 5000, seed), draws);
  }
  for (const auto& [cell, count] : draws) counted += count;
  ASSERT_GT(counted, 0u);
  const auto inserted = density.activate(draws, 8);
  size_t added = 0;
  for (size_t l = 0; l < inserted.size(); ++l) {
    added += inserted[l].size();
    for (const uint32_t row : inserted[l]) {
      const auto key = std::make_pair(static_cast<int>(l), density.levels()[l].cells[row]);
      EXPECT_GE(draws.at(key), 8u);
    }
  }
  EXPECT_GT(added, 0u);
  EXPECT_EQ(density.activeCellCount(), before.activeCellCount() + added);
  // Even choices stored are even choices: -log 8 rounded twice.
  EXPECT_NEAR(density.entropy(), before.entropy(), 1e-5);
  const AnchorSet one = sampled(before, 3000);
  const AnchorSet other = sampled(density, 3000);
  EXPECT_EQ(one.leaves, other.leaves);
  EXPECT_TRUE(density.activate(draws, 8)[1].empty()) << "a second time";
}

TEST(LearnedDensity, MovesIntoNewSpace) {
  // All prior points in one corner; an objective that likes the opposite corner.
  const std::vector<float> points(3 * 50, 0.05f);
  LearnedDensity density = LearnedDensity::fromPoints(points, {}, {{0, 0, 0}, 1.0}, 4);
  LearnedDensity::DrawCounts draws;
  const uint64_t goal = 4095;
  double before = logDensity(density.levels(), goal);
  for (int step = 1; step <= 600; ++step) {
    const AnchorSet anchors = sampled(density, 4000, static_cast<uint64_t>(step));
    density.countDraws(anchors, draws);
    std::vector<double> g(anchors.size());
    for (size_t i = 0; i < g.size(); ++i) {
      g[i] = anchors.leaves[i] == goal ? -1.0 : 0.0;
      g[i] -= anchors.leaves[i] >> 3 == goal >> 3 ? 0.1 : 0.0;
      g[i] -= anchors.leaves[i] >> 9 == goal >> 9 ? 0.1 : 0.0;
    }
    const DensityGradient gradient = density.logDensityGradient(anchors, g);
    for (size_t l = 0; l < gradient.levels.size(); ++l) {
      const auto& level = gradient.levels[l];
      std::vector<float> logits;
      for (size_t i = 0; i < level.values.size(); ++i) {
        const float old = density.levels()[l].logits[level.rows[i / 8] * size_t{8} + i % 8];
        const double sign = level.values[i] < 0 ? -1 : level.values[i] > 0 ? 1 : 0;
        logits.push_back(old - static_cast<float>(0.05 * sign));
      }
      density.setLogits(static_cast<int>(l), level.rows, logits);
    }
    if (step % 100 == 0) {
      density.activate(draws, 8);
      draws.clear();
    }
  }
  EXPECT_LT(before, std::log(1e-3));
  EXPECT_GT(logDensity(density.levels(), goal), std::log(0.5));
}

TEST(LearnedDensity, FreezesToAnOctreeOfTheSameShares) {
  const LearnedDensity density = wavyDensity(50000, 4);
  const OctreeDensity octree = density.frozen();
  EXPECT_EQ(octree.leafLevel(), 4);
  EXPECT_EQ(octree.root().origin, kRoot.origin);
  const AnchorSet anchors = sampled(octree, 20000);
  // What is left out: the even share of each of four levels, and choices below it.
  double worst = 0;
  for (size_t i = 0; i < anchors.size(); ++i) {
    const double difference =
        static_cast<double>(anchors.log_q[i]) - logDensity(density.levels(), anchors.leaves[i]);
    worst = std::max(worst, std::abs(difference));
  }
  EXPECT_LT(worst, 0.12);
  EXPECT_GT(octree.leafCount(), 100u);
}

TEST(LearnedDensity, FreezesWithoutWhatWasNeverLearned) {
  // A chain down to one leaf, and a heavy choice with nothing below it.
  std::vector<LearnedLevel> levels(3);
  levels[0] = {{0}, {0, 0, -30, -30, -30, -30, -30, -30}, std::vector<float>(8, 0.0f)};
  levels[1] = {{0}, {5, -30, -30, -30, -30, -30, -30, -30}, std::vector<float>(8, 0.0f)};
  levels[2] = {{0}, {5, -30, -30, -30, -30, -30, -30, -30}, std::vector<float>(8, 0.0f)};
  const OctreeDensity octree = LearnedDensity(kRoot, levels).frozen();
  EXPECT_EQ(octree.leafCount(), 1u);
  // An octree is as deep as what was learned.
  const OctreeDensity even = LearnedDensity(kRoot, 6, 3).frozen();
  EXPECT_EQ(even.leafLevel(), 3);
  EXPECT_EQ(even.leafCount(), 512u);
}

TEST(LearnedDensity, TakesPointsThatAreNoUse) {
  EXPECT_EQ(LearnedDensity::fromPoints({}, {}, kRoot, 3).activeCellCount(), 1u);
  const std::vector<float> outside = {9, 9, 9};
  EXPECT_EQ(LearnedDensity::fromPoints(outside, {}, kRoot, 3).activeCellCount(), 1u);
  const std::vector<float> inside = {0, 0, 0};
  EXPECT_EQ(
      LearnedDensity::fromPoints(inside, std::vector<float>{0.0f}, kRoot, 3).activeCellCount(), 1u);
  const LearnedDensity one = LearnedDensity::fromPoints(inside, {}, kRoot, 3);
  EXPECT_EQ(one.activeCellCount(), 3u);
  EXPECT_EQ(sampled(one, 1).size(), 1u);
  const std::vector<float> bad = {0, std::nanf(""), 0};
  // Told of down to cells of 1/2: below them choices are even, and leaves stay where they are.
  const LearnedDensity coarse = LearnedDensity::fromPoints(inside, {}, kRoot, 3, 1);
  EXPECT_EQ(coarse.leafLevel(), 3);
  EXPECT_EQ(coarse.activeCellCount(), 1u);
  const std::vector<uint64_t> cell = {0};
  std::vector<float> choices(8), deep(8);
  coarse.childLogProbabilities(0, cell, choices);
  one.childLogProbabilities(0, cell, deep);
  EXPECT_EQ(choices, deep);
  coarse.childLogProbabilities(1, cell, choices);
  for (const float choice : choices) EXPECT_NEAR(choice, -std::log(8.0f), 1e-6f);
  EXPECT_THROW(LearnedDensity::fromPoints(bad, {}, kRoot, 3), Error);
  EXPECT_THROW(LearnedDensity(kRoot, 11), Error);
}

TEST(LearnedDensity, RefusesStoredLevelsThatDoNotFitTogether) {
  const auto messageOf = [](std::vector<LearnedLevel> levels) -> std::string {
    try {
      LearnedDensity density(kRoot, std::move(levels));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const std::vector<LearnedLevel> good = wavyDensity(100, 3).levels();
  EXPECT_EQ(messageOf(good), "");
  std::vector<LearnedLevel> levels = good;
  levels[1].logits.pop_back();
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("level 1 of the density has"));
  levels = good;
  std::swap(levels[2].cells[0], levels[2].cells[1]);
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("out of order"));
  levels = good;
  levels[0].cells[0] = 1;
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("the root alone"));
  levels = good;
  levels[0].logits[3] = std::nanf("");
  EXPECT_THAT(messageOf(levels), ::testing::HasSubstr("logits"));
}

TEST(LearnedDensity, InsertsRowsOfZeros) {
  std::vector<float> values = {1, 2, 3, 4};
  insertZeroRows(values, 2, std::vector<uint32_t>{0, 2, 4});
  EXPECT_EQ(values, (std::vector<float>{0, 0, 1, 2, 0, 0, 3, 4, 0, 0}));
}

}  // namespace
}  // namespace stipple
