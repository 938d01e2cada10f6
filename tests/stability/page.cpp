#include "page.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

namespace stipple::testing {

namespace {

constexpr const char* kHead =
    "# Numerical stability\n\n"
    "This command makes the page:\n\n"
    "    STIPPLE_STABILITY_TABLE=docs/numerical_stability.md \\\n"
    "      build/release/tests/test_stability --gtest_filter='*Stability.EveryHardCase*'\n\n"
    "Everything here is drawn with floating-point traps on: a division by zero, an overflow or an "
    "invalid operation ends the test. No image has a NaN, an alpha outside 0..1 or a colour "
    "outside the hull of the splats' colours, up to rounding (1e-5 of levels, 1e-4 of effects). "
    "NaN, infinity and rotations of zero are refused at the entry, with a message.\n\n"
    "## Levels\n\n"
    "Every case at each level with every low-pass, draft and preview with their share of the "
    "splats, merged by the tree that makes it. The numbers are the largest difference of any "
    "channel of any pixel between single and double precision of the same setting; 1 is white.\n\n"
    "| case | the plain form | here | draft | preview | final | order pixel | rays | reference |\n"
    "|---|---|---|---|---|---|---|---|---|\n";

constexpr const char* kEffects =
    "\n## Effects\n\n"
    "The number is the largest difference, 1 is white. Wide cameras draw in double precision and "
    "are judged by the same rays in long double, every splat at every pixel, with directions, "
    "sizes and responses from formulas of their own; the others by the same moments, points of "
    "the lens and places in double. What a row measures instead stands in its last column.\n\n"
    "| effect | case | the plain form | here | error | judged by |\n"
    "|---|---|---|---|---|---|\n";

constexpr size_t kPageWidth = 120;  // characters of a line of documentation

/// The text with its long lines broken at spaces; rows of tables and indented commands stay whole.
std::string wrapped(const std::string& text) {
  std::istringstream lines(text);
  std::string out, line;
  while (std::getline(lines, line)) {
    if (line.size() > kPageWidth && line[0] != '|' && line[0] != ' ') {
      size_t start = 0;
      while (line.size() - start > kPageWidth) {
        const size_t space = line.rfind(' ', start + kPageWidth);
        line[space] = '\n';
        start = space + 1;
      }
    }
    out += line + '\n';
  }
  return out;
}

class Writing : public ::testing::Environment {
 public:
  void TearDown() override {
    const char* path = std::getenv("STIPPLE_STABILITY_TABLE");
    if (!path || ::testing::UnitTest::GetInstance()->Failed()) return;
    const StabilityPage& page = StabilityPage::ofThisRun();
    ASSERT_FALSE(page.levels.empty() || page.effects.empty())
        << "the page needs the tests *Stability.EveryHardCase*";
    std::ofstream(path) << wrapped(kHead + page.levels + kEffects + page.effects);
  }
};

}  // namespace

StabilityPage& StabilityPage::ofThisRun() {
  static StabilityPage page;
  return page;
}

std::string shortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1e", value);
  return value == 0 ? "0" : text;
}

void writePageAfterTests() {
  ::testing::AddGlobalTestEnvironment(new Writing);  // gtest frees it
}

}  // namespace stipple::testing
