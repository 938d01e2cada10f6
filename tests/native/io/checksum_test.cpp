#include "io/bytes/checksum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace stipple {
namespace {

uint64_t sumOf(const std::string& text) {
  Checksum sum;
  sum.add(text.data(), text.size());
  return sum.value();
}

// The values that xxhsum -H64 gives.
TEST(Checksum, IsXxh64) {
  EXPECT_EQ(sumOf(""), 0xef46db3751d8e999u);
  EXPECT_EQ(sumOf("a"), 0xd24ec4f1a98c6e5bu);
  EXPECT_EQ(sumOf("abc"), 0x44bc2cf5ad770999u);
  EXPECT_EQ(sumOf("Nobody inspects the spammish repetition"), 0xfbcea83c8a378bf1u);
}

TEST(Checksum, DoesNotDependOnThePieces) {
  std::string text;
  for (int i = 0; i < 203; ++i) text += static_cast<char>(i * 7);
  for (size_t piece = 1; piece <= text.size(); ++piece) {
    Checksum sum;
    for (size_t at = 0; at < text.size(); at += piece) {
      sum.add(text.data() + at, std::min(piece, text.size() - at));
    }
    EXPECT_EQ(sum.value(), sumOf(text)) << piece;
  }
}

}  // namespace
}  // namespace stipple
