#include "base/number_text.h"

#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <cstdio>
#include <limits>

namespace stipple {
namespace {

// Messages and files were written by printf before; they stay as they are.
TEST(NumberText, IsWhatPrintfWrites) {
  const double values[] = {0.0,
                           -0.0,
                           1.0,
                           0.1,
                           -2.5,
                           1e-5,
                           1e-4,
                           123456,
                           1e6,
                           1.5e22,
                           1e300,
                           -4.9e-324,
                           1.0 / 3.0,
                           999999.5,
                           100,
                           1e-310,
                           std::numeric_limits<double>::max(),
                           std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()};
  for (const double value : values) {
    for (const int digits : {1, 3, 4, 6, 17}) {
      char expected[64];
      std::snprintf(expected, sizeof(expected), "%.*g", digits, value);
      EXPECT_EQ(numberText(value, digits), expected);
    }
    char expected[64];
    std::snprintf(expected, sizeof(expected), "%g", value);
    EXPECT_EQ(numberText(value), expected);
  }
}

TEST(NumberText, KnowsNoLocale) {
  const std::string before = std::setlocale(LC_NUMERIC, nullptr);
  bool found = false;
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8"})
    found = found || std::setlocale(LC_NUMERIC, name);
  const std::string text = numberText(0.5);
  std::setlocale(LC_NUMERIC, before.c_str());
  if (!found) GTEST_SKIP() << "no locale with a decimal comma is installed";
  EXPECT_EQ(text, "0.5");
}

TEST(SizeText, NamesWidthAndHeight) {
  EXPECT_EQ(sizeText(640, 480), "640 x 480");
}

}  // namespace
}  // namespace stipple
