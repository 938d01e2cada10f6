#include "math/half_float.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace stipple {
namespace {

TEST(HalfFloat, EveryNumberComesBack) {
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<uint16_t>(bits);
    const float value = halfToFloat(half);
    if (std::isnan(value)) {
      EXPECT_TRUE(std::isnan(halfToFloat(floatToHalf(value)))) << bits;
    } else {
      EXPECT_EQ(floatToHalf(value), half) << bits;
    }
  }
}

TEST(HalfFloat, WhatIsBetweenGoesToTheNearestAndFromTheMiddleToTheEvenOne) {
  for (uint32_t bits = 0; bits < 0x7bff; ++bits) {
    const auto half = static_cast<uint16_t>(bits), next = static_cast<uint16_t>(bits + 1);
    const double low = static_cast<double>(halfToFloat(half));
    const double high = static_cast<double>(halfToFloat(next));
    const auto at = [&](double share) { return static_cast<float>(low + share * (high - low)); };
    ASSERT_EQ(floatToHalf(at(0.25)), half) << bits;
    ASSERT_EQ(floatToHalf(at(0.75)), next) << bits;
    ASSERT_EQ(floatToHalf(at(0.5)), bits % 2 == 0 ? half : next) << bits;
    ASSERT_EQ(floatToHalf(-at(0.75)), next | 0x8000) << bits;
  }
  EXPECT_EQ(floatToHalf(65519.0f), 0x7bff);
  EXPECT_EQ(floatToHalf(65520.0f), 0x7c00);
  EXPECT_EQ(floatToHalf(-std::numeric_limits<float>::infinity()), 0xfc00);
  EXPECT_EQ(floatToHalf(std::numeric_limits<float>::denorm_min()), 0);
}

}  // namespace
}  // namespace stipple
