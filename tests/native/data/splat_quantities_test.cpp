#include "data/clouds/splat_quantities.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

/// A splat of these scales and rotation.
std::vector<float> axisOf(const std::vector<float>& scales, const std::vector<float>& rotation) {
  SplatCloud cloud;
  cloud.resize(1);
  cloud.scales = scales;
  cloud.rotations = rotation;
  return splitAxes(cloud);
}

TEST(SplatQuantities, TheSplitAxisIsTheLongestOneByHowClearItIs) {
  // 1 - 0.1 / 0.4 along y.
  EXPECT_EQ(axisOf({0.1f, 0.4f, 0.05f}, {1, 0, 0, 0}), (std::vector<float>{0, 0.75f, 0}));
  // A quarter turn around x takes y to z; the quaternion's length says nothing.
  const std::vector<float> turned = axisOf({0.1f, 0.4f, 0.05f}, {3, 3, 0, 0});
  EXPECT_NEAR(turned[0], 0, 1e-7);  // one rounding of the stored quaternion
  EXPECT_NEAR(turned[1], 0, 1e-7);
  EXPECT_NEAR(turned[2], 0.75, 1e-7);
}

TEST(SplatQuantities, ARoundSplatHasNoSplitAxisAndANeedleAWholeOne) {
  const std::vector<float> none = {0, 0, 0};
  EXPECT_EQ(axisOf({0.3f, 0.3f, 0.3f}, {1, 0, 0, 0}), none);
  EXPECT_EQ(axisOf({0.3f, 0.3f, 0.001f}, {1, 0, 0, 0}), none);  // a disc: two equal axes
  EXPECT_EQ(axisOf({0, 0, 0}, {1, 0, 0, 0}), none);
  EXPECT_EQ(axisOf({1e-30f, 1e-30f, 1}, {1, 0, 0, 0}), (std::vector<float>{0, 0, 1}));
  const float most = std::numeric_limits<float>::max();
  EXPECT_EQ(axisOf({most, 0, 0}, {1, 0, 0, 0}), (std::vector<float>{1, 0, 0}));
}

TEST(SplatQuantities, TheSplitAxisIsTheSameForAnyThreads) {
  SplatCloud cloud;
  cloud.resize(40000);  // several ranges of the loop
  for (size_t i = 0; i < cloud.size(); ++i) {
    const double angle = 0.1 * static_cast<double>(i);
    cloud.rotations[i * 4] = static_cast<float>(std::cos(angle));
    cloud.rotations[i * 4 + 1 + i % 3] = static_cast<float>(std::sin(angle));
    for (size_t k = 0; k < 3; ++k) {
      cloud.scales[i * 3 + k] = static_cast<float>(1 + (i * 7 + k * 5) % 11);
    }
  }
  std::vector<float> one, many;
  withThreads(1, [&] { one = splitAxes(cloud); });
  withThreads(4, [&] { many = splitAxes(cloud); });
  EXPECT_EQ(one, many);
  for (size_t i = 0; i < one.size(); i += 3) {
    EXPECT_LE(std::hypot(one[i], one[i + 1], one[i + 2]), 1.0000001);  // rounding of the last bit
  }
}

TEST(SplatQuantities, OfACloudWithoutSplatsThereIsNone) {
  EXPECT_TRUE(splitAxes(SplatCloud{}).empty());
  EXPECT_THROW(SplatQuantities{}.of(SplatQuantity::kSplitAxis), Error);
}

}  // namespace
}  // namespace stipple
