#include "io/assets/asset_time.h"

#include <gtest/gtest.h>

#include "scratch_folder.h"

namespace stipple {
namespace {

TEST(AssetTime, StandsInTheSettingsBesideWhatTheyHold) {
  const std::string settings = settingsWithTime(R"({"seed":7})", {0.25, 3});
  EXPECT_NE(settings.find(R"("seed":7)"), std::string::npos);
  const auto time = timeOfSettings(settings, "a");
  ASSERT_TRUE(time);
  EXPECT_EQ(time->begin, 0.25);
  EXPECT_EQ(time->end, 3);
  EXPECT_EQ(timeOfSettings(settingsWithTime(settings, {4, 4}), "a")->begin, 4);
}

TEST(AssetTime, IsNoneWhereNothingMoves) {
  EXPECT_FALSE(timeOfSettings("{}", "a"));
}

TEST(AssetTime, RefusesHostileSettings) {
  for (const char* settings :
       {"", "[]", "{", R"({"time":3})", R"({"time":{"begin":0}})",
        R"({"time":{"begin":"0","end":1}})", R"({"time":{"begin":2,"end":1}})",
        R"({"time":{"begin":0,"end":1e999}})"}) {
    expectError(ErrorCode::kFormat, {"file: "}, [&] { timeOfSettings(settings, "file"); });
  }
}

}  // namespace
}  // namespace stipple
