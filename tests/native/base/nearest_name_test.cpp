#include "base/nearest_name.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace stipple {
namespace {

TEST(NearestName, CountsLettersToChange) {
  EXPECT_EQ(editDistance("", ""), 0u);
  EXPECT_EQ(editDistance("", "abc"), 3u);
  EXPECT_EQ(editDistance("kitten", "sitting"), 3u);
  EXPECT_EQ(editDistance("sitting", "kitten"), 3u);
}

TEST(NearestName, FindsWhatIsMeantAndNothingWhereNothingIsNear) {
  const std::vector<std::string> known = {"seed", "steps", "batch"};
  EXPECT_EQ(nearestName("step", known), "steps");
  EXPECT_EQ(nearestName("bacht", known), "batch");
  EXPECT_EQ(nearestName("learning", known), "");
  EXPECT_EQ(nearestName("", known), "");
}

}  // namespace
}  // namespace stipple
