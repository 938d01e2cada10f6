#include "math/radix_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <random>

#include "base/parallel.h"

namespace stipple {
namespace {

KeyedIndices randomKeys(size_t count, uint64_t mask, unsigned seed) {
  std::mt19937_64 random(seed);
  KeyedIndices keys(count);
  for (size_t i = 0; i < count; ++i) keys[i] = {random() & mask, static_cast<uint32_t>(i)};
  std::shuffle(keys.begin(), keys.end(), random);
  return keys;
}

TEST(RadixOrder, IsThatOfComparingForKeysOfAnyWidth) {
  // Few different keys leave ties; 200,000 are more than are sorted by comparing.
  for (const uint64_t mask : {~uint64_t{0}, uint64_t{0x7fffffffffffffff}, uint64_t{0xffff},
                              uint64_t{7}, uint64_t{0}, uint64_t{0xff00000000000000}}) {
    for (const size_t count : {size_t{0}, size_t{1}, size_t{100}, size_t{200000}}) {
      KeyedIndices keys = randomKeys(count, mask, 3);
      KeyedIndices expected = keys;
      std::sort(expected.begin(), expected.end());
      sortByKey(keys);
      EXPECT_TRUE(keys == expected) << count << " keys of " << mask;
    }
  }
}

TEST(RadixOrder, TakesKeysOfWhichNearlyAllAreAlike) {
  // What a scene with one far splat gives: all others share the highest bits.
  KeyedIndices keys = randomKeys(200000, 0xfffff, 4);
  keys[77].key = uint64_t{1} << 62;
  KeyedIndices expected = keys;
  std::sort(expected.begin(), expected.end());
  sortByKey(keys);
  EXPECT_TRUE(keys == expected);
}

TEST(RadixOrder, IsTheSameForAnyNumberOfThreads) {
  KeyedIndices one = randomKeys(150000, 0xfffffffff, 5);
  KeyedIndices four = one;
  withThreads(1, [&] { sortByKey(one); });
  withThreads(4, [&] { sortByKey(four); });
  EXPECT_TRUE(one == four);
}

TEST(RadixOrder, SortsFloatsOfEverySign) {
  std::mt19937 random(6);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  for (const size_t count : {size_t{0}, size_t{5}, size_t{3000}, size_t{100000}}) {
    std::vector<float> values(count);
    for (float& value : values) value = std::ldexp(normal(random), int(random() % 60) - 30);
    if (count > 10) {
      values[1] = std::numeric_limits<float>::max();
      values[2] = -std::numeric_limits<float>::max();
      values[3] = std::numeric_limits<float>::denorm_min();
      values[4] = 0.0f;
      values[5] = values[6];
    }
    std::vector<float> expected = values;
    std::sort(expected.begin(), expected.end());
    sortFloats(values);
    EXPECT_EQ(values, expected) << count;
  }
  // -0 and 0 are equal; their order is that of their signs.
  std::vector<float> zeros(5000, 0.0f);
  for (size_t i = 0; i < zeros.size(); i += 2) zeros[i] = -0.0f;
  sortFloats(zeros);
  EXPECT_EQ(std::bit_cast<uint32_t>(zeros.front()), 0x80000000u);
  EXPECT_EQ(std::bit_cast<uint32_t>(zeros.back()), 0u);
}

}  // namespace
}  // namespace stipple
