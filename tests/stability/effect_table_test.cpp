#include <gtest/gtest.h>

#include "effect_table.h"
#include "page.h"

// The table of effects in docs/numerical_stability.md, measured with traps on.

namespace stipple {
namespace {

TEST(EffectsStability, EveryHardCaseIsNearItsJudge) {
  std::string table;
  for (const testing::EffectCase& hard : testing::effectCases()) {
    SCOPED_TRACE(hard.name);
    const double error = hard.measure();
    EXPECT_LE(error, hard.most);
    table += "| " + hard.effect + " | " + hard.name + " | " + hard.naive + " | " + hard.ours +
             " | " + testing::shortNumber(error) + " | " + hard.judge + " |\n";
  }
  testing::StabilityPage::ofThisRun().effects = table;
}

}  // namespace
}  // namespace stipple
