#include "data/weight_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/assets/weight_file.h"
#include "io/scratch_folder.h"
#include "math/half_float.h"
#include "test_numbers.h"

namespace stipple {
namespace {

class WeightFile : public ScratchFolder {
 protected:
  /// A safetensors file by hand: header, then bytes.
  std::string file(const std::string& header, const std::string& data) const {
    const uint64_t length = header.size();
    std::string bytes(reinterpret_cast<const char*>(&length), sizeof(length));
    return store("net.safetensors", bytes + header + data);
  }
};

TEST(Widen, MakesEveryHalfTheSameFloat) {
  std::vector<uint16_t> halves(65536);
  for (size_t i = 0; i < halves.size(); ++i) halves[i] = static_cast<uint16_t>(i);
  const WeightTensor tensor = {
      WeightType::kFloat16, "F16", {65536}, reinterpret_cast<const uint8_t*>(halves.data())};
  std::vector<float> out(halves.size());
  widen(tensor, 0, out);
  for (size_t i = 0; i < halves.size(); ++i) {
    const float expected = halfToFloat(halves[i]);
    if (std::isnan(expected)) {
      ASSERT_TRUE(std::isnan(out[i])) << i;
    } else {
      ASSERT_EQ(std::bit_cast<uint32_t>(out[i]), std::bit_cast<uint32_t>(expected)) << i;
    }
  }
}

TEST(Widen, TakesAPieceOfBfloat16) {
  const WeightTable table =
      TableBuilder().addBfloat16("w", {2, 2}, {1.0f, -2.5f, 0.15625f, 96.0f}).table();
  std::vector<float> out(2);
  widen(table.require("w", {2, kAnySize}), 1, out);
  EXPECT_EQ(out, (std::vector<float>{-2.5f, 0.15625f}));
}

TEST(WeightTable, GivesTensorsUnderAPrefixAndCountsBlocks) {
  const WeightTable table = TableBuilder()
                                .add("blocks.0.w", {1}, {1})
                                .add("blocks.1.w", {1}, {2})
                                .add("blocks.10.w", {1}, {3})
                                .add("other", {}, {4})
                                .table();
  EXPECT_EQ(table.countBlocks("blocks."), 2u);
  EXPECT_EQ(table.under("blocks.1").under(".").floats("w", {1}), std::vector<float>{2});
  EXPECT_EQ(table.under("blocks.").names(), (std::vector<std::string>{"0.w", "1.w", "10.w"}));
  // A single number counts as one of shape [1].
  EXPECT_EQ(table.floats("other", {1}), std::vector<float>{4});
  EXPECT_EQ(table.floats("other", {}), std::vector<float>{4});
  EXPECT_EQ(table.unread(), (std::vector<std::string>{"blocks.0.w", "blocks.10.w"}));
  EXPECT_EQ(table.under("blocks.10.").unread(), std::vector<std::string>{"blocks.10.w"});
  EXPECT_FALSE(table.under("blocks.").has("w"));
}

TEST(WeightTable, SaysWhatIsWrongWithATensor) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const uint8_t bytes[16] = {};
  const WeightTable table =
      TableBuilder()
          .add("a.w", {2, 3}, numbers(6, 1))
          .add("a.nan", {2, 2}, {0, 1, nan, 2})
          .addBfloat16("a.infinite", {2}, {0, -std::numeric_limits<float>::infinity()})
          .addBytes("a.whole", WeightType::kOther, "I64", {2}, bytes, 16)
          .table()
          .under("a.");
  const auto refused = [&](std::initializer_list<const char*> texts, const char* name,
                           std::vector<uint64_t> shape) {
    expectError(ErrorCode::kFormat, texts, [&] { table.floats(name, shape); });
  };
  refused({"net.safetensors", "'a.missing'", "[2, any]"}, "missing", {2, kAnySize});
  refused({"net.safetensors", "'a.w'", "[2, 3]", "[3, 2]"}, "w", {3, 2});
  refused({"'a.w'", "[2, 3]", "[6]"}, "w", {6});
  refused({"'a.whole'", "I64", "F32, F16 or BF16"}, "whole", {2});
  refused({"'a.nan'", "NaN", "number 2"}, "nan", {2, 2});
  refused({"'a.infinite'", "infinity", "number 1"}, "infinite", {2});
  expectError(ErrorCode::kFormat, {"'w'"}, [] { WeightTable().require("w", {1}); });
  EXPECT_TRUE(WeightTable().names().empty());
  EXPECT_EQ(WeightTable().countBlocks("w"), 0u);
}

TEST_F(WeightFile, IsMappedAndOutlivesItsName) {
  std::map<std::string, std::string> metadata;
  std::string data("\x00\x3c\x80\xbf", 4);  // 1 as F16, -1 as BF16
  const std::string name = file(
      R"({"__metadata__":{"kind":"test"},"h":{"dtype":"F16","shape":[1],"data_offsets":[0,2]},)"
      R"("b":{"dtype":"BF16","shape":[],"data_offsets":[2,4]}})",
      data);
  const WeightTable table = openWeightFile(name, &metadata);
  std::filesystem::remove(name);
  EXPECT_EQ(metadata.at("kind"), "test");
  EXPECT_EQ(table.floats("h", {1}), std::vector<float>{1});
  EXPECT_EQ(table.floats("b", {1}), std::vector<float>{-1});
  EXPECT_EQ(table.source(), name);
}

TEST_F(WeightFile, IsRefusedWhereItsHeaderLies) {
  const auto refused = [&](std::initializer_list<const char*> texts, const std::string& name) {
    expectError(ErrorCode::kFormat, texts, [&] { openWeightFile(name); });
  };
  const std::string data(8, '\0');
  refused({"'w'", "8 bytes of data"},
          file(R"({"w":{"dtype":"F32","shape":[4],"data_offsets":[0,16]}})", data));
  refused({"'w'", "F16"}, file(R"({"w":{"dtype":"F16","shape":[3],"data_offsets":[0,8]}})", data));
  refused({"share the bytes"}, file(R"({"v":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},)"
                                    R"("w":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}})",
                                    data));
  refused({"at least 8"}, store("short", "1234567"));
  refused({"is not a safetensors file"}, store("text", "not a file of weights"));
  expectError(ErrorCode::kIo, {"none"}, [&] { openWeightFile(path("none")); });
}

}  // namespace
}  // namespace stipple
