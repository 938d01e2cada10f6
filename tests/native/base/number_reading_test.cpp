#include "base/number_reading.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>

namespace stipple {
namespace {

/// Both ways read as much, call it the same and come to the same bits.
template <typename Number>
void expectAlike(const std::string& text) {
  constexpr Number kBefore = 77;
  Number first = kBefore, second = kBefore;
  const char* end = text.data() + text.size();
  const auto expected = std::from_chars(text.data(), end, first);
  const auto found = readByParts(text.data(), end, second);
  EXPECT_EQ(found.ec, expected.ec) << text;
  EXPECT_EQ(found.ptr - text.data(), expected.ptr - text.data()) << text;
  if (std::isnan(first)) {
    EXPECT_TRUE(std::isnan(second)) << text;
  } else {
    EXPECT_EQ(second, first) << text;
    EXPECT_EQ(std::signbit(second), std::signbit(first)) << text;
  }
}

void expectAlikeInBoth(const std::string& text) {
  expectAlike<float>(text);
  expectAlike<double>(text);
}

TEST(NumberReading, ReadsWhatTheLibraryReads) {
  for (const char* text : {"0",
                           "-0",
                           "1",
                           "-1.5",
                           ".5",
                           "5.",
                           "1e5",
                           "1E-5",
                           "1e+3",
                           "1e",
                           "1e+",
                           "1e400",
                           "-1e400",
                           "1e-400",
                           "1e39",
                           "1e-46",
                           "3.5e38",
                           "",
                           "-",
                           ".",
                           "-.",
                           "+1",
                           " 1",
                           "e5",
                           "1.2.3",
                           "1,5",
                           "0x1p3",
                           "inf",
                           "-INF",
                           "Infinity",
                           "infinite",
                           "nan",
                           "-NaN(a)",
                           "nan(a b)",
                           "nanx",
                           "1e-310",
                           "4.9e-324",
                           "2e-324",
                           "0e999999",
                           "0.0e-99",
                           "1e22",
                           "1e23",
                           "1e1000000000000",
                           "9007199254740993",
                           "16777217",
                           "000000000000000000000000000000000000000001.25",
                           "123456789012345678901234567890",
                           "1.00000000000000000000000000000000000000000000000001",
                           "1234567890123456789000e-21"}) {
    expectAlikeInBoth(text);
  }
}

TEST(NumberReading, RoundsAsTheLibraryDoes) {
  std::mt19937_64 random(3);
  char text[64];
  for (int k = 0; k < 20000; ++k) {
    const auto bits = random();
    const int digits = static_cast<int>(random() % 20);
    std::snprintf(text, sizeof(text), "%.*g", digits, std::bit_cast<double>(bits));
    expectAlikeInBoth(text);
    const auto small = std::bit_cast<float>(static_cast<uint32_t>(bits));
    std::snprintf(text, sizeof(text), "%.*e", digits, static_cast<double>(small));
    expectAlikeInBoth(text);
    const double usual = static_cast<double>(static_cast<int64_t>(bits)) * 1e-18;
    std::snprintf(text, sizeof(text), "%.*f", digits, usual);
    expectAlikeInBoth(text);
  }
}

TEST(NumberReading, ReadsWholeNumbersToo) {
  const std::string text = "42x";
  int value = 0;
  const auto [stop, error] = readNumber(text.data(), text.data() + text.size(), value);
  EXPECT_EQ(error, std::errc());
  EXPECT_EQ(value, 42);
  EXPECT_EQ(*stop, 'x');
}

}  // namespace
}  // namespace stipple
