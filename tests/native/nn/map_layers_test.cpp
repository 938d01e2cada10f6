// Group normalisation and pooling of feature maps.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/group_norm.h"
#include "nn/made_weights.h"
#include "nn/max_pool.h"

namespace stipple {
namespace {

FeatureMap mapOf(size_t height, size_t width, size_t channels, const std::vector<float>& values) {
  FeatureMap map = FeatureMap::ofSize(height, width, channels);
  std::copy(values.begin(), values.end(), map.values.begin());
  return map;
}

TEST(GroupNorm, TakesMeanAndVarianceOfAGroupsChannelsAndPixels) {
  MadeWeights weights;
  weights.add("norm.weight", {4}, {1.0f, 2.0f, 1.0f, 1.0f});
  weights.add("norm.bias", {4}, {0.0f, 10.0f, 0.0f, -1.0f});
  const FeatureMap map = mapOf(1, 2, 4, {1, 3, 5, 5, 3, 1, 5, 5});
  const ChannelNorm norm = GroupNorm(weights.table(), "norm", 4, 2, 1e-6f).of({}, map);
  std::vector<float> out(8);
  normalise(norm, 2, map.values.data(), out.data());
  // Mean 2, variance 1 + 1e-6; the second group is constant.
  const std::vector<float> expected = {-1, 12, 0, -1, 1, 8, 0, -1};
  for (size_t i = 0; i < 8; ++i) EXPECT_NEAR(out[i], expected[i], 2e-6f);
}

TEST(GroupNorm, KeepsSmallDifferencesOfLargeNumbers) {
  MadeWeights weights;
  weights.add("norm.weight", {1}, {1.0f});
  weights.add("norm.bias", {1}, {0.0f});
  std::vector<float> values(10000);
  for (size_t i = 0; i < values.size(); ++i) values[i] = 100000.0f + (i % 2 == 0 ? 0.5f : -0.5f);
  const FeatureMap map = mapOf(100, 100, 1, values);
  const ChannelNorm norm = GroupNorm(weights.table(), "norm", 1, 1, 1e-6f).of({}, map);
  std::vector<float> out(values.size());
  normalise(norm, values.size(), values.data(), out.data());
  // Sums in double know the variance, 0.25 of 1e10, to 1e10 * 2^-53 * some steps: 1e-5 of it.
  EXPECT_NEAR(out[0], 1.0f, 1e-4f);
  EXPECT_NEAR(out[1], -1.0f, 1e-4f);
}

TEST(GroupNorm, GivesTheSameBitsForAnyNumberOfThreads) {
  MadeWeights weights;
  weights.addLayer("norm", {6});
  const GroupNorm layer(weights.table(), "norm", 6, 3, 1e-6f);
  const FeatureMap map = mapOf(90, 70, 6, numbers(90 * 70 * 6, 4));
  ChannelNorm one;
  withThreads(1, [&] { one = layer.of({}, map); });
  withThreads(3, [&] {
    const ChannelNorm three = layer.of({}, map);
    EXPECT_EQ(three.mean, one.mean);
    EXPECT_EQ(three.factor, one.factor);
  });
}

TEST(GroupNorm, RefusesChannelsThatMakeNoGroups) {
  MadeWeights weights;
  weights.addLayer("norm", {6});
  try {
    GroupNorm(weights.table(), "norm", 6, 4, 1e-6f);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFormat);
    EXPECT_THAT(error.what(), testing::HasSubstr("6 channels; a multiple of 4"));
  }
}

TEST(MaxPool, TakesTheLargestOfEachWindow) {
  // Two channels, the second the first one's negative.
  std::vector<float> values;
  for (const float value : {1.0f, 5.0f, 2.0f, 0.0f, 3.0f, -4.0f, 7.0f, 8.0f, 6.0f, -1.0f}) {
    values.push_back(value);
    values.push_back(-value);
  }
  const FeatureMap out = maxPool({}, mapOf(2, 5, 2, values), 2, 2);
  EXPECT_EQ(out.height, 1u);
  EXPECT_EQ(out.width, 2u);
  EXPECT_THAT(out.values, testing::ElementsAre(7.0f, 4.0f, 8.0f, 0.0f));
}

TEST(MaxPool, WalksOverlappingWindowsWithTheSameBitsForAnyNumberOfThreads) {
  const FeatureMap map = mapOf(31, 21, 3, numbers(31 * 21 * 3, 6));
  FeatureMap one;
  withThreads(1, [&] { one = maxPool({}, map, 3, 2); });
  withThreads(3, [&] { EXPECT_EQ(maxPool({}, map, 3, 2).values, one.values); });
  ASSERT_EQ(one.height, 15u);
  ASSERT_EQ(one.width, 10u);
  for (size_t i = 0; i < one.values.size(); ++i) {
    const size_t y = i / 30 * 2, x = i / 3 % 10 * 2;
    float largest = -2.0f;
    for (size_t k = 0; k < 9; ++k) {
      largest = std::max(largest, map.values[((y + k / 3) * 21 + x + k % 3) * 3 + i % 3]);
    }
    ASSERT_EQ(one.values[i], largest);
  }
}

TEST(MaxPool, RefusesMapsWithoutAWindow) {
  const FeatureMap map = mapOf(1, 4, 1, {1, 2, 3, 4});
  EXPECT_THROW(maxPool({}, map, 2, 2), Error);
  EXPECT_THROW(maxPool({}, map, 1, 0), Error);
  EXPECT_THROW(maxPool({}, map, 0, 1), Error);
}

}  // namespace
}  // namespace stipple
