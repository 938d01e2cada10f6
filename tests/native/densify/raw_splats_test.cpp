#include "densify/raw_splats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace stipple {
namespace {

TEST(RawSplats, OpacitiesAndScalesComeBackUpToTheirEnds) {
  for (const float opacity : {1e-5f, 0.1f, 0.5f, 0.9f, 0.99f, 0.9999f}) {
    // A logit of 10 is rounded to 5e-7, of which the opacity's distance to its end is a factor.
    EXPECT_NEAR(activatedOpacity(rawOpacity(opacity)), opacity,
                1e-6f * std::min(opacity, 1 - opacity) + 6e-8f);
  }
  EXPECT_FLOAT_EQ(activatedOpacity(rawOpacity(0)), kLeastRawOpacity);
  EXPECT_NEAR(activatedOpacity(rawOpacity(1)), 1 - kLeastRawOpacity, 6e-8f);
  for (const float scale : {1e-20f, 1e-3f, 1.0f, 1e5f, 1e30f}) {
    // A logarithm of 70 is rounded to 4e-6.
    EXPECT_NEAR(activatedScale(rawScale(scale)) / scale, 1, 5e-6f);
  }
  EXPECT_NEAR(activatedScale(rawScale(0)) / kLeastRawScale, 1, 5e-6f);
}

TEST(RawSplats, ActivationsNeverLeaveTheirRange) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  for (const float raw : {-kLargest, -1000.0f, -88.0f, 0.0f, 88.0f, 1000.0f, kLargest}) {
    EXPECT_GE(activatedOpacity(raw), 0);
    EXPECT_LE(activatedOpacity(raw), 1);
    EXPECT_GE(activatedScale(raw), 0);
    EXPECT_TRUE(std::isfinite(activatedScale(raw)));
  }
  EXPECT_FLOAT_EQ(activatedOpacity(2) + activatedOpacity(-2), 1);
  EXPECT_EQ(activatedOpacity(0), 0.5f);
}

TEST(RawSplats, KeepEverythingElseBitForBit) {
  SplatCloud cloud;
  cloud.sh_degree = 1;
  cloud.colour_space = ColourSpace::kLinear;
  cloud.antialias = Antialias::kMip;
  cloud.resize(3);
  for (size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] = 0.1f * static_cast<float>(i);
  for (size_t i = 0; i < 12; ++i) cloud.rotations[i] = static_cast<float>(i) - 5;
  for (size_t i = 0; i < 9; ++i) cloud.positions[i] = cloud.scales[i] = static_cast<float>(i);
  const SplatCloud back = activated(rawSplats(cloud));
  EXPECT_EQ(back.positions, cloud.positions);
  EXPECT_EQ(back.rotations, cloud.rotations);
  EXPECT_EQ(back.sh, cloud.sh);
  EXPECT_EQ(back.sh_degree, 1);
  EXPECT_EQ(back.colour_space, ColourSpace::kLinear);
  EXPECT_EQ(back.antialias, Antialias::kMip);
  RawSplats raw = rawSplats(cloud);
  raw.resize(5);
  EXPECT_EQ(raw.sh.size(), 5u * 12);
  EXPECT_EQ(raw.logits[4], 0.0f);
}

}  // namespace
}  // namespace stipple
