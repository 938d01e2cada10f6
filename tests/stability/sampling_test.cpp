#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "density/anchor_expectations.h"
#include "density/anchor_sampling.h"
#include "density/density_fixtures.h"

namespace stipple {
namespace {

TEST(OctreeDensity, TakesTheExtremesOfFloat) {
  const float largest = std::numeric_limits<float>::max();
  const float smallest = std::numeric_limits<float>::denorm_min();
  const OctreeDensity wide =
      OctreeDensity::fromPoints(std::vector<float>{-largest, 0, 0, largest, 0, 0},
                                std::vector<float>{smallest, largest}, {10});
  EXPECT_EQ(wide.leafCount(), 2u);
  EXPECT_TRUE(std::isfinite(wide.root().side));
  // The tiny mass is 1e-83 of the large one: its logarithm is -192, not -inf.
  EXPECT_LT(
      *std::min_element(wide.logProbabilities(0).begin(), wide.logProbabilities(0).begin() + 1),
      -100.0f);
  const OctreeDensity narrow =
      OctreeDensity::fromPoints(std::vector<float>{0, 0, 0, smallest, 0, 0}, {}, {10});
  EXPECT_EQ(narrow.leafCount(), 2u);
  const OctreeDensity far = OctreeDensity::fromPoints(
      std::vector<float>{1e6f, 1e6f, 1e6f, 1e6f + 0.0625f, 1e6f, 1e6f}, {}, {10});
  EXPECT_EQ(far.leafCount(), 2u);
}

TEST(AnchorSampling, OneLeafTakesEveryAnchor) {
  const OctreeDensity density = OctreeDensity::fromPoints(std::vector<float>{1, 2, 3}, {}, {10});
  for (const AnchorOrder order : kBothOrders) {
    for (const uint64_t count : {1u, 100000u}) {
      const AnchorSet anchors = sampleAnchors(density, {.count = count, .order = order});
      expectValid(density, anchors, count);
      EXPECT_EQ(anchors.log_q[0], 0.0f);
    }
  }
}

TEST(AnchorSampling, UniformOctreeFarBelowTheBudgetIsEven) {
  // Eight full children everywhere, 512 leaves, 1000 anchors a leaf and 300 over.
  const ConstantModel model(3, [] {
    std::array<float, 8> logs;
    logs.fill(std::log(0.125f));
    return logs;
  }());
  for (const AnchorOrder order : kBothOrders) {
    const AnchorSet anchors = sampleAnchors(model, {.count = 512300, .order = order, .seed = 2});
    const auto counts = leafCounts(anchors);
    ASSERT_EQ(counts.size(), 512u);
    // Systematic: each level moves a child by less than one: below 1 + 1/8 + 1/64. Progressive:
    // nine halvings, each off by less than one: below 2.
    const double bound = order == AnchorOrder::kSystematic ? 1.15 : 2.0;
    for (const auto& [leaf, count] : counts) {
      EXPECT_NEAR(static_cast<double>(count), 512300.0 / 512, bound);
    }
  }
}

TEST(AnchorSampling, EmptyAndVanishingBranchesGetNoAnchor) {
  // exp(-800) is 0 in double; exp(-60) is real mass, far below one anchor.
  const ConstantModel model(10,
                            {kNoMass, -800.0f, 0.0f, kNoMass, -60.0f, kNoMass, kNoMass, kNoMass});
  for (const AnchorOrder order : kBothOrders) {
    const AnchorSet anchors = sampleAnchors(model, {.count = 100000, .order = order});
    for (const uint64_t leaf : anchors.leaves) {
      for (int level = 0; level < 10; ++level) {
        const uint64_t child = leaf >> (3 * level) & 7;
        ASSERT_TRUE(child == 2 || child == 4);
      }
    }
  }
}

TEST(AnchorSampling, HighestLeavesStayInTheUnitCube) {
  const ConstantModel model(10, {kNoMass, kNoMass, kNoMass, kNoMass, kNoMass, kNoMass, kNoMass, 0});
  const AnchorSet anchors = sampleAnchors(model, {.count = 200000});
  const auto [low, high] = std::minmax_element(anchors.positions.begin(), anchors.positions.end());
  EXPECT_GE(*low, 1023.0f / 1024.0f);
  EXPECT_LT(*high, 1.0f);
  // The largest number of a recorded stream, too, stays below the leaf's upper edge.
  RecordedUniformSource source(std::vector<double>(13, 1.0 - 0x1.0p-53));
  const AnchorSet edge = sampleAnchors(model, {.count = 1}, source);
  for (const float value : edge.positions) EXPECT_EQ(value, 1.0f - 0x1.0p-24f);
}

}  // namespace
}  // namespace stipple
