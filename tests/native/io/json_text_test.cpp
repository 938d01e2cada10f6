#include "io/bytes/json_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "io/bytes/limits.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

std::string nested(size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

TEST(JsonText, IsCountedAsItsParserSeesIt) {
  const JsonSize size = sizeOfJson(R"( {"a[{":[1,-2.5e3,"\"]\\",true , null],"b":{"c":{}}} )");
  EXPECT_EQ(size.depth, 3u);
  EXPECT_EQ(size.objects, 3u);
  EXPECT_EQ(size.values, 12u);  // three objects, three keys, a list and its five
  EXPECT_EQ(sizeOfJson("").values, 0u);
  EXPECT_EQ(sizeOfJson("]]]][").depth, 1u);
  EXPECT_EQ(sizeOfJson("\"never ends [[[").depth, 0u);
  EXPECT_EQ(sizeOfJson("\"\\").values, 1u);
}

TEST(JsonText, IsRefusedBeyondItsDepth) {
  EXPECT_EQ(parseJson(nested(kMaxJsonDepth), "a").size(), 1u);
  expectError(ErrorCode::kFormat, {"a.json", "nested 257 deep", "at most 256"},
              [] { parseJson(nested(kMaxJsonDepth + 1), "a.json"); });
  expectError(ErrorCode::kInvalidArgument, {"a.json", "1000000 deep"}, [] {
    parseOrderedJson(std::string(1000000, '['), "a.json", ErrorCode::kInvalidArgument);
  });
}

TEST(JsonText, IsRefusedBeyondItsNumberOfValues) {
  std::string text = "[0";
  for (uint64_t i = 2; i < kMaxJsonValues; ++i) text += ",0";
  requireSmallJson(text + "]", "a");
  expectError(ErrorCode::kFormat, {"a.json", "4194305 values", "at most 4194304"},
              [&] { parseJson(text + ",0]", "a.json"); });
}

TEST(JsonText, SaysWhatIsWrongWithIt) {
  expectError(ErrorCode::kFormat, {"a.json is not valid JSON: "}, [] { parseJson("{", "a.json"); });
  EXPECT_EQ(parseOrderedJson(R"({"b":1,"a":2})", "a").dump(), R"({"b":1,"a":2})");
}

TEST(Limits, AllowMoreForLargerFiles) {
  const Allowance allowance = {100, 3};
  EXPECT_EQ(allowance.of(0), 100u);
  EXPECT_EQ(allowance.of(10), 130u);
  EXPECT_EQ(allowance.of(UINT64_MAX / 2), UINT64_MAX);
  requireAllowed(130, allowance, 10, "a.bin", "its 3 parts");
  expectError(ErrorCode::kFormat, {"a.bin: its 3 parts", "131 bytes", "130 are allowed", "10 bytes"},
              [&] { requireAllowed(131, allowance, 10, "a.bin", "its 3 parts"); });
}

}  // namespace
}  // namespace stipple
