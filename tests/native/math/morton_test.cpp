#include "math/morton.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

namespace stipple {
namespace {

TEST(Morton, PutsXLowestAndZHighest) {
  EXPECT_EQ(mortonEncode(1, 0, 0), 1u);
  EXPECT_EQ(mortonEncode(0, 1, 0), 2u);
  EXPECT_EQ(mortonEncode(0, 0, 1), 4u);
}

TEST(Morton, InterleavesBitByBit) {
  for (const auto& [x, y, z] : {std::array<uint32_t, 3>{3, 5, 6}, {1023, 0, 511}, {85, 51, 15}}) {
    uint64_t code = 0;
    for (int bit = 0; bit < 21; ++bit) {
      code |= uint64_t{x >> bit & 1u} << (3 * bit) | uint64_t{y >> bit & 1u} << (3 * bit + 1) |
              uint64_t{z >> bit & 1u} << (3 * bit + 2);
    }
    EXPECT_EQ(mortonEncode(x, y, z), code);
  }
}

TEST(Morton, DecodesWhatItEncodesUpToTwentyOneBits) {
  uint32_t state = 1;
  for (int i = 0; i < 10000; ++i) {
    std::array<uint32_t, 3> cell;
    for (uint32_t& value : cell) value = (state = state * 1664525u + 1013904223u) >> 11;
    EXPECT_EQ(mortonDecode(mortonEncode(cell[0], cell[1], cell[2])), cell);
  }
  EXPECT_EQ(mortonDecode(mortonEncode(0x1fffff, 0x1fffff, 0x1fffff)),
            (std::array<uint32_t, 3>{0x1fffff, 0x1fffff, 0x1fffff}));
}

TEST(Morton, ChildOfACellHasItsCodeAppended) {
  const uint64_t parent = mortonEncode(12, 7, 30);
  EXPECT_EQ(mortonEncode(2 * 12 + 1, 2 * 7, 2 * 30 + 1), parent << 3 | 5u);
}

}  // namespace
}  // namespace stipple
