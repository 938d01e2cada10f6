#include "math/low_discrepancy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace stipple {
namespace {

TEST(LowDiscrepancy, EveryDimensionHasOnePointInEachInterval) {
  for (uint32_t dimension = 0; dimension < kSobolDimensions; ++dimension) {
    for (const uint32_t count : {1u, 2u, 16u, 256u}) {
      for (const uint32_t first : {0u, count, 5 * count}) {
        std::vector<int> hit(count, 0);
        for (uint32_t i = 0; i < count; ++i) {
          const double value = scrambledSobol(first + i, dimension);
          ASSERT_GE(value, 0);
          ASSERT_LT(value, 1);
          ++hit[static_cast<size_t>(value * count)];
        }
        for (const int hits : hit) ASSERT_EQ(hits, 1);
      }
    }
  }
}

TEST(LowDiscrepancy, TheFirstTwoDimensionsFillEveryBoxOfOneArea) {
  constexpr uint32_t kLevels = 8, kCount = 1 << kLevels;
  for (uint32_t across = 0; across <= kLevels; ++across) {
    std::vector<int> hit(kCount, 0);
    const uint32_t columns = 1u << across, rows = kCount / columns;
    for (uint32_t i = 0; i < kCount; ++i) {
      const auto x = static_cast<uint32_t>(scrambledSobol(i, 0) * columns);
      const auto y = static_cast<uint32_t>(scrambledSobol(i, 1) * rows);
      ++hit[y * columns + x];
    }
    for (const int hits : hit) ASSERT_EQ(hits, 1) << across;
  }
}

TEST(LowDiscrepancy, MeansOfASmoothFunctionFallFasterThanThoseOfRandomPoints) {
  // The mean of the product of (1 + (x - 1/2)) is 1; random points would be off by 0.6 / sqrt(n).
  const auto error = [](uint32_t count) {
    double sum = 0;
    for (uint32_t i = 0; i < count; ++i) {
      double product = 1;
      for (uint32_t d = 0; d < kSobolDimensions; ++d) product *= 0.5 + scrambledSobol(i, d);
      sum += product;
    }
    return std::abs(sum / count - 1);
  };
  EXPECT_LT(error(64), 0.02);
  EXPECT_LT(error(4096), 5e-4);
}

}  // namespace
}  // namespace stipple
