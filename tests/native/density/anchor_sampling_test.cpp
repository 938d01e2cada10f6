#include "density/anchor_sampling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "anchor_expectations.h"
#include "base/error.h"
#include "base/parallel.h"
#include "density_fixtures.h"

namespace stipple {
namespace {

using testing::AllOf;
using testing::HasSubstr;

void expectSameBits(const AnchorSet& a, const AnchorSet& b) {
  EXPECT_TRUE(a.positions == b.positions);
  EXPECT_TRUE(a.log_q == b.log_q);
  EXPECT_TRUE(a.leaves == b.leaves);
  EXPECT_TRUE(a.ranks == b.ranks);
  EXPECT_EQ(a.leaf_level, b.leaf_level);
}

/// Expects the child counts of every parent to be floor or ceil of n p. The rounding of n p itself
/// is worth 1e-9 at these n: an expectation that close to a whole number may round either way.
void expectFloorOrCeil(const OctreeDensity& density, const AnchorSet& anchors) {
  std::map<uint64_t, uint64_t> counts = leafCounts(anchors);
  for (int level = density.leafLevel() - 1; level >= 0; --level) {
    std::map<uint64_t, uint64_t> parents;
    for (const auto& [cell, count] : counts) parents[cell >> 3] += count;
    for (const auto& [parent, n] : parents) {
      std::array<float, 8> logs;
      density.childLogProbabilities(level, std::span(&parent, 1), logs);
      double total = 0.0;
      for (const float log_p : logs) total += std::exp(static_cast<double>(log_p));
      for (uint64_t k = 0; k < 8; ++k) {
        const double expected =
            static_cast<double>(n) * std::exp(static_cast<double>(logs[k])) / total;
        const auto child = counts.find(parent << 3 | k);
        const double seen = child == counts.end() ? 0.0 : static_cast<double>(child->second);
        ASSERT_GE(seen, std::floor(expected - 1e-9));
        ASSERT_LE(seen, std::ceil(expected + 1e-9));
      }
    }
    counts = std::move(parents);
  }
}

TEST(SystematicSampling, GivesTheCountsOfAHandCheckedCase) {
  // Ten anchors, masses 1:2:5 of 8 in children 0, 3, 6: expectations 1.25, 2.5, 6.25.
  // U = 0.3: u_j = 0.03, 0.13, ..., 0.93. At or below 0.125: one; 0.375: four; 1: ten.
  const OctreeDensity density = oneLevel({1, 0, 0, 2, 0, 0, 5, 0});
  std::vector<double> stream{0.3};
  stream.resize(31, 0.5);
  RecordedUniformSource source(stream);
  const AnchorSet anchors = sampleAnchors(density, {.count = 10}, source);
  EXPECT_EQ(leafCounts(anchors), (std::map<uint64_t, uint64_t>{{0, 1}, {3, 3}, {6, 6}}));
  EXPECT_EQ(source.drawnCount(), 31u);
  // Child 6 = (0, 1, 1): u = 0.5 in it is (0.25, 0.75, 0.75).
  EXPECT_EQ(anchors.positions[3 * 9], 0.25f);
  EXPECT_EQ(anchors.positions[3 * 9 + 1], 0.75f);
  EXPECT_EQ(anchors.positions[3 * 9 + 2], 0.75f);
  EXPECT_EQ(anchors.log_q[9], std::log(5.0f / 8.0f));
}

TEST(SystematicSampling, DrawZeroNeverLandsInAnEmptyChild) {
  const OctreeDensity density = oneLevel({0, 0, 1, 0, 1, 0, 0, 0});
  std::vector<double> stream(10, 0.0);
  RecordedUniformSource source(stream);
  const AnchorSet anchors = sampleAnchors(density, {.count = 3}, source);
  // u_j = 0, 1/3, 2/3: two at or below 1/2.
  EXPECT_EQ(leafCounts(anchors), (std::map<uint64_t, uint64_t>{{2, 2}, {4, 1}}));
}

TEST(SystematicSampling, EveryChildCountIsFloorOrCeilOfItsExpectation) {
  const OctreeDensity density = wavyOctree(5000, 6);
  for (const uint64_t count : {1u, 7u, 1000u, 20011u}) {
    for (const uint64_t seed : {0u, 1u, 2u}) {
      expectFloorOrCeil(density, sampleAnchors(density, {.count = count, .seed = seed}));
    }
  }
}

TEST(SystematicSampling, MeanCountsAreThoseOfTheDensity) {
  const OctreeDensity density = oneLevel({1, 2, 3, 4, 5, 6, 7, 8});
  std::array<double, 8> mean{};
  constexpr uint64_t kSeeds = 20000;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    for (const uint64_t leaf : sampleAnchors(density, {.count = 5, .seed = seed}).leaves) {
      mean[leaf] += 1.0 / kSeeds;
    }
  }
  // A count is one of two neighbours: its deviation is at most 1/2, that of the mean 0.0035; 4.5
  // sigma.
  for (size_t k = 0; k < 8; ++k) EXPECT_NEAR(mean[k], 5.0 * (k + 1.0) / 36.0, 0.016);
}

TEST(AnchorSampling, GivesExactlyTheBudgetInMortonOrderInsideTheLeaves) {
  for (const int leaf_level : {1, 2, 5, 10}) {
    const OctreeDensity density = wavyOctree(4000, leaf_level);
    for (const AnchorOrder order : kBothOrders) {
      for (const uint64_t count : {1u, 2u, 999u, 30000u}) {
        expectValid(density, sampleAnchors(density, {.count = count, .order = order, .seed = 9}),
                    count);
      }
    }
  }
}

TEST(AnchorSampling, TablesGiveTheBitsOfLevelByLevelSampling) {
  // 70,000 anchors make many tasks, and leaves that are larger than a task at level 1.
  for (const int leaf_level : {1, 4, 10}) {
    const OctreeDensity density = wavyOctree(50000, leaf_level);
    for (const AnchorOrder order : kBothOrders) {
      for (const uint64_t count : {1u, 1000u, 70000u}) {
        AnchorSamplingOptions options{.count = count, .order = order, .seed = 4};
        options.with_ranks = order == AnchorOrder::kProgressive;
        expectSameBits(sampleAnchors(density, options), sampleAnchors(AnyModel(density), options));
      }
    }
  }
}

TEST(AnchorSampling, IsTheSameForAnyThreadCountAndDependsOnTheSeed) {
  const OctreeDensity density = wavyOctree(50000, 8);
  for (const AnchorOrder order : kBothOrders) {
    AnchorSamplingOptions options{.count = 50000, .order = order, .seed = 11};
    options.with_ranks = order == AnchorOrder::kProgressive;
    AnchorSet sets[2][2];
    for (const unsigned threads : {1u, 2u}) {
      withThreads(threads, [&] {
        sets[threads - 1][0] = sampleAnchors(density, options);
        sets[threads - 1][1] = sampleAnchors(AnyModel(density), options);
      });
    }
    expectSameBits(sets[0][0], sets[1][0]);
    expectSameBits(sets[0][1], sets[1][1]);
    options.seed = 12;
    EXPECT_FALSE(sampleAnchors(density, options).leaves == sets[0][0].leaves);
  }
}

TEST(AnchorSampling, AKeyedSourceGivesTheLeavesOfItsSeed) {
  const OctreeDensity density = wavyOctree(5000, 7);
  for (const AnchorOrder order : kBothOrders) {
    AnchorSamplingOptions options{.count = 3000, .order = order, .seed = 21};
    options.with_ranks = order == AnchorOrder::kProgressive;
    KeyedUniformSource source(21);
    const AnchorSet from_source = sampleAnchors(density, options, source);
    const AnchorSet from_seed = sampleAnchors(density, options);
    expectValid(density, from_source, 3000);
    EXPECT_TRUE(from_source.leaves == from_seed.leaves);
    EXPECT_TRUE(from_source.ranks == from_seed.ranks);
  }
}

TEST(AnchorSampling, JitterIsUniformInTheLeaf) {
  const OctreeDensity density = oneLevel({0, 0, 0, 1, 0, 0, 0, 0});
  const AnchorSet anchors = sampleAnchors(density, {.count = 100000, .seed = 3});
  std::array<std::array<double, 10>, 3> histogram{};
  std::array<double, 3> products{};
  for (size_t i = 0; i < anchors.size(); ++i) {
    std::array<double, 3> u;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double position = static_cast<double>(anchors.positions[3 * i + axis]);
      u[axis] = 2.0 * position - (axis < 2 ? 1.0 : 0.0);
      histogram[axis][static_cast<size_t>(10 * u[axis])] += 1.0;
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      products[axis] += (u[axis] - 0.5) * (u[(axis + 1) % 3] - 0.5) / 1e5;
    }
  }
  for (const auto& bins : histogram) {
    // 10,000 a bin, deviation 95: five sigma.
    for (const double bin : bins) EXPECT_NEAR(bin, 10000, 475);
  }
  // Deviation of the mean of 1e5 products, each of variance 1/144: 2.6e-4; five sigma.
  for (const double product : products) EXPECT_NEAR(product, 0.0, 1.3e-3);
}

TEST(AnchorSampling, RefusesBudgetsAndOptionsOutOfRange) {
  const OctreeDensity density = wavyOctree(100, 3);
  const auto refusal = [&](const DensityModel& model, const AnchorSamplingOptions& options) {
    try {
      sampleAnchors(model, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal(density, {.count = 0}),
              AllOf(HasSubstr("budget is 0"), HasSubstr("1 to 268435456")));
  EXPECT_THAT(refusal(density, {.count = kMaxAnchorCount + 1}), HasSubstr("268435457"));
  EXPECT_THAT(refusal(density, {.count = ~uint64_t{0}}), HasSubstr("18446744073709551615"));
  EXPECT_THAT(refusal(density, {.order = static_cast<AnchorOrder>(2)}), HasSubstr("order is 2"));
  EXPECT_THAT(refusal(density, {.with_ranks = true}), HasSubstr("progressive"));
  EXPECT_THAT(refusal(OctreeDensity(), {}), HasSubstr("leaf level is 0"));
}

TEST(AnchorSampling, RefusesAModelThatGivesNoDistribution) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::array<float, 8> none;
  none.fill(kNoMass);
  for (const AnchorOrder order : kBothOrders) {
    const AnchorSamplingOptions options{.order = order};
    EXPECT_THROW(sampleAnchors(ConstantModel(3, none), options), Error);
    EXPECT_THROW(sampleAnchors(ConstantModel(3, {0, 0, 0, 0, nan, 0, 0, 0}), options), Error);
    EXPECT_THROW(sampleAnchors(ConstantModel(3, {0, 0, 0, 0, -kNoMass, 0, 0, 0}), options), Error);
    EXPECT_THROW(sampleAnchors(ConstantModel(11, {0, 0, 0, 0, 0, 0, 0, 0}), options), Error);
  }
}

TEST(AnchorSampling, StopsWhenCancelled) {
  const OctreeDensity density = wavyOctree(1000, 6);
  for (const AnchorOrder order : kBothOrders) {
    Progress progress;
    progress.cancel();
    const AnchorSamplingOptions options{.count = 100000, .order = order};
    for (const bool tables : {true, false}) {
      const AnyModel model(density);
      const DensityModel& sampled = tables ? static_cast<const DensityModel&>(density) : model;
      try {
        sampleAnchors(sampled, options, &progress);
        FAIL() << "not cancelled";
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kCancelled);
      }
    }
  }
}

TEST(AnchorSampling, ReportsProgressToTheEnd) {
  Progress progress;
  sampleAnchors(wavyOctree(1000, 6), {.count = 50000}, &progress);
  EXPECT_EQ(progress.fraction(), 1.0);
}

TEST(RecordedUniformSource, RefusesToRunOutAndNumbersOutsideTheUnitInterval) {
  const OctreeDensity density = oneLevel({1, 1, 0, 0, 0, 0, 0, 0});
  RecordedUniformSource short_source({0.1, 0.2});
  EXPECT_THROW(sampleAnchors(density, {.count = 2}, short_source), Error);
  for (const double bad : {1.0, -0.1, std::nan("")}) {
    RecordedUniformSource bad_source({bad});
    EXPECT_THROW(bad_source.uniform(RandomUse::kLeafJitter, 0), Error);
  }
}

TEST(AnchorSampling, MemoryStaysBelowItsBound) {
  // Checked where the arrays are known: the result and two frontiers of one cell an anchor.
  for (const uint64_t count : {uint64_t{1}, uint64_t{1000000}, kMaxAnchorCount}) {
    EXPECT_GE(sampleMemoryBound(count, false), count * (24 + 2 * 20));
    EXPECT_GE(sampleMemoryBound(count, true), sampleMemoryBound(count, false) + 16 * count);
    EXPECT_LT(sampleMemoryBound(count, true), count * 200 + (uint64_t{32} << 20));
  }
}

}  // namespace
}  // namespace stipple
