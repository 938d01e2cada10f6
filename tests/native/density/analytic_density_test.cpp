#include <gtest/gtest.h>

#include <map>

#include "analytic_density.h"
#include "density/anchor_sampling.h"

namespace stipple {
namespace {

constexpr uint64_t kCount = 200000;
constexpr int kLeafLevel = 8;

AnchorSet drawn(const DensityModel& density, AnchorOrder order) {
  AnchorSamplingOptions options;
  options.count = kCount;
  options.order = order;
  options.seed = 5;
  return sampleAnchors(density, options);
}

TEST(AnySampledDensity, GivesLogQInClosedForm) {
  const AnchorSet anchors = drawn(AnalyticDensity(kLeafLevel), AnchorOrder::kSystematic);
  ASSERT_EQ(anchors.size(), kCount);
  for (size_t i = 0; i < anchors.size(); ++i) {
    // Eight numbers below 8 are rounded to float32, and their sum, below 32, once more.
    ASSERT_NEAR(static_cast<double>(anchors.log_q[i]),
                std::log(AnalyticDensity::mass(anchors.leaves[i], kLeafLevel)),
                8 * 2.4e-7 + 1.9e-6);
  }
}

TEST(AnySampledDensity, PutsAsManyAnchorsIntoEachCellAsItsMassAsksFor) {
  for (const AnchorOrder order : {AnchorOrder::kSystematic, AnchorOrder::kProgressive}) {
    const AnchorSet anchors = drawn(AnalyticDensity(kLeafLevel), order);
    constexpr int kLevel = 3;
    std::map<uint64_t, double> counts;
    for (const uint64_t leaf : anchors.leaves) counts[leaf >> (3 * (kLeafLevel - kLevel))] += 1;
    for (uint64_t cell = 0; cell < uint64_t{1} << (3 * kLevel); ++cell) {
      // A count is off by less than 1 for each 8-way choice on its path; for each of the three
      // binary splits of a choice in the progressive order.
      const double allowed = kLevel * (order == AnchorOrder::kSystematic ? 1 : 3);
      ASSERT_NEAR(counts[cell], kCount * AnalyticDensity::mass(cell, kLevel), allowed)
          << "cell " << cell;
    }
  }
}

TEST(AnySampledDensity, IsAskedForManyCellsAtOnce) {
  const AnalyticDensity density(kLeafLevel);
  drawn(density, AnchorOrder::kSystematic);
  constexpr size_t kCellsOfAQuestion = 32768;
  EXPECT_GT(density.cells_asked, kCount / 2);
  EXPECT_LE(density.questions, density.cells_asked / kCellsOfAQuestion + kLeafLevel);
}

}  // namespace
}  // namespace stipple
