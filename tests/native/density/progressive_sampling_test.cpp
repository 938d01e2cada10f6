#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "density/anchor_sampling.h"
#include "density_fixtures.h"

namespace stipple {
namespace {

using Anchor = std::tuple<uint64_t, float, float, float, float>;

std::vector<Anchor> listOf(const AnchorSet& anchors) {
  std::vector<Anchor> list;
  for (size_t i = 0; i < anchors.size(); ++i) {
    list.emplace_back(anchors.leaves[i], anchors.log_q[i], anchors.positions[3 * i],
                      anchors.positions[3 * i + 1], anchors.positions[3 * i + 2]);
  }
  std::sort(list.begin(), list.end());
  return list;
}

AnchorSet progressive(const DensityModel& model, uint64_t count, uint64_t seed,
                      bool with_ranks = false) {
  return sampleAnchors(
      model,
      {.count = count, .order = AnchorOrder::kProgressive, .seed = seed, .with_ranks = with_ranks});
}

/// The shares of the binary splits from the root to each leaf, upper half first by child bit 2, 1,
/// 0.
std::map<uint64_t, std::vector<double>> pathShares(const OctreeDensity& density) {
  std::map<uint64_t, std::vector<double>> paths{{0, {}}};
  for (int level = 0; level < density.leafLevel(); ++level) {
    std::map<uint64_t, std::vector<double>> next;
    for (size_t i = 0; i < density.cells(level).size(); ++i) {
      const uint64_t cell = density.cells(level)[i];
      std::array<double, 8> p;
      for (size_t k = 0; k < 8; ++k) {
        p[k] = std::exp(static_cast<double>(density.logProbabilities(level)[8 * i + k]));
      }
      for (uint64_t k = 0; k < 8; ++k) {
        if (p[k] == 0.0) continue;
        std::vector<double> path = paths.at(cell);
        double whole = 0.0;
        for (size_t other = 0; other < 8; ++other) whole += p[other];
        for (const int bit : {2, 1, 0}) {
          double half = 0.0;
          for (uint64_t other = 0; other < 8; ++other) {
            if (other >> bit == k >> bit) half += p[other];
          }
          path.push_back(half / whole);
          whole = half;
        }
        next[cell << 3 | k] = path;
      }
    }
    paths = std::move(next);
  }
  return paths;
}

TEST(ProgressiveSampling, GivesTheCountsOfAHandCheckedCase) {
  // Masses 1:3 in children 0 and 1: one binary split, p = 3/4. U = 0.6: floor(n 3/4 + 0.6) of n go
  // up: 1, 2, 2, 3, 4, 5 for n = 1..6, so the ranks of child 0 are 3 and the ones of child 1 the
  // rest.
  const OctreeDensity density = oneLevel({1, 3, 0, 0, 0, 0, 0, 0});
  const uint64_t up[] = {1, 2, 2, 3, 4, 5};
  for (uint64_t n = 1; n <= 6; ++n) {
    std::vector<double> stream(1 + 3 * n, 0.6);
    RecordedUniformSource source(stream);
    const AnchorSet anchors = sampleAnchors(
        density, {.count = n, .order = AnchorOrder::kProgressive, .with_ranks = true}, source);
    EXPECT_EQ(static_cast<uint64_t>(std::count(anchors.leaves.begin(), anchors.leaves.end(), 1u)),
              up[n - 1]);
    EXPECT_EQ(source.drawnCount(), 1 + 3 * n);
    if (n == 6) {
      EXPECT_EQ(std::vector<uint64_t>(anchors.ranks.begin(), anchors.ranks.end()),
                (std::vector<uint64_t>{3, 1, 2, 4, 5, 6}));
    }
  }
}

TEST(ProgressiveSampling, SmallerBudgetsAreSubsetsWithTheSamePositionsAndLogQ) {
  const OctreeDensity density = wavyOctree(3000, 7);
  for (const uint64_t seed : {1u, 2u, 3u}) {
    std::vector<Anchor> larger = listOf(progressive(density, 20000, seed));
    for (const uint64_t count : {19999u, 7001u, 1000u, 64u, 2u, 1u}) {
      std::vector<Anchor> smaller = listOf(progressive(density, count, seed));
      ASSERT_EQ(smaller.size(), count);
      EXPECT_TRUE(std::includes(larger.begin(), larger.end(), smaller.begin(), smaller.end()));
      larger = std::move(smaller);
    }
  }
}

TEST(ProgressiveSampling, EveryBudgetAddsOneAnchorToTheOneBelow) {
  const OctreeDensity density = wavyOctree(300, 4);
  std::vector<Anchor> before;
  for (uint64_t count = 1; count <= 400; ++count) {
    std::vector<Anchor> now = listOf(progressive(density, count, 5));
    ASSERT_EQ(now.size(), count);
    ASSERT_TRUE(std::includes(now.begin(), now.end(), before.begin(), before.end()));
    before = std::move(now);
  }
}

TEST(ProgressiveSampling, RanksAreTheSmallestBudgetsByBruteForce) {
  const OctreeDensity density = wavyOctree(500, 5);
  const AnyModel model(density);
  constexpr uint64_t kCount = 600;
  for (const DensityModel* sampled :
       {static_cast<const DensityModel*>(&density), static_cast<const DensityModel*>(&model)}) {
    const AnchorSet anchors = progressive(*sampled, kCount, 8, true);
    ASSERT_EQ(anchors.ranks.size(), kCount);
    std::map<uint64_t, std::vector<uint64_t>> first_budgets;  // of each leaf, from budgets 1..P
    for (uint64_t count = 1; count <= kCount; ++count) {
      std::map<uint64_t, size_t> counts;
      for (const uint64_t leaf : progressive(density, count, 8).leaves) ++counts[leaf];
      for (const auto& [leaf, n] : counts) {
        if (first_budgets[leaf].size() < n) first_budgets[leaf].push_back(count);
      }
    }
    size_t at = 0;
    for (const auto& [leaf, budgets] : first_budgets) {
      for (const uint64_t budget : budgets) {
        ASSERT_EQ(anchors.leaves[at], leaf);
        EXPECT_EQ(anchors.ranks[at], budget);
        ++at;
      }
    }
    EXPECT_EQ(at, kCount);
  }
}

TEST(ProgressiveSampling, AnchorsUpToARankAreTheSmallerBudget) {
  const OctreeDensity density = wavyOctree(20000, 9);
  const AnchorSet all = progressive(density, 100000, 3, true);
  const AnchorSet part = progressive(density, 12345, 3);
  size_t at = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all.ranks[i] > 12345) continue;
    ASSERT_LT(at, part.size());
    EXPECT_EQ(all.leaves[i], part.leaves[at]);
    EXPECT_EQ(all.positions[3 * i], part.positions[3 * at]);
    ++at;
  }
  EXPECT_EQ(at, part.size());
}

TEST(ProgressiveSampling, CountsStayWithinTheBoundOfTheirPath) {
  const OctreeDensity density = wavyOctree(2000, 6);
  const auto paths = pathShares(density);
  for (const uint64_t count : {1u, 100u, 5000u, 200000u}) {
    for (const uint64_t seed : {1u, 2u}) {
      std::map<uint64_t, double> counts;
      for (const uint64_t leaf : progressive(density, count, seed).leaves) counts[leaf] += 1.0;
      for (const auto& [leaf, shares] : paths) {
        double q = 1.0;
        double bound = 0.0;
        for (const double share : shares) {
          q *= share;
          // A split adds less than one and scales what was there; a certain split adds nothing.
          bound = share * bound + (share < 1.0 ? 1.0 : 0.0);
        }
        // Shares are multiples of 2^-32: 18 splits, each off by at most 2^-32 of the budget.
        const double quantisation = static_cast<double>(count) * 18 * 0x1.0p-32;
        ASSERT_LT(std::abs(counts[leaf] - static_cast<double>(count) * q), bound + quantisation);
      }
    }
  }
}

TEST(ProgressiveSampling, MeanCountsAreThoseOfTheDensity) {
  const OctreeDensity density = wavyOctree(8, 3, 2);
  const auto paths = pathShares(density);
  constexpr uint64_t kSeeds = 20000;
  std::map<uint64_t, double> mean;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    for (const uint64_t leaf : progressive(density, 7, seed).leaves) mean[leaf] += 1.0 / kSeeds;
  }
  for (const auto& [leaf, shares] : paths) {
    double q = 1.0;
    for (const double share : shares) q *= share;
    // Deviation of one count below 1.5 (the bound of few splits), of the mean 0.011; 4.5 sigma.
    EXPECT_NEAR(mean[leaf], 7 * q, 0.05);
  }
}

}  // namespace
}  // namespace stipple
