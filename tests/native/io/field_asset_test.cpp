#include "io/assets/field_asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

#include "base/error.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class FieldAssetFile : public ScratchFolder {};

FieldAsset smallAsset() {
  const float none = -HUGE_VALF;
  FieldAsset asset;
  asset.root_origin = {-1.5, 0.25, 2.0};
  asset.root_side = 4.0;
  asset.cells = {{0}, {2}};
  asset.log_probabilities = {{none, none, 0.0f, none, none, none, none, none},
                             {0.0f, none, none, none, none, none, none, none}};
  asset.field_level = 7;
  asset.gaussians = 16;
  asset.sh_degree = 2;
  asset.least_anchors = 100;
  asset.most_anchors = 5000;
  asset.jitter = false;
  asset.contracted = true;
  asset.nested = true;
  asset.seed = UINT64_MAX;
  asset.colour_space = ColourSpace::kLinear;
  asset.antialias = Antialias::kClassic;
  asset.tensors["field.features.level3"] = {{2, 3}, std::vector<float>{1, 2, 3, 4, 5, 6}};
  asset.tensors["field.network.layer0.biases"] = {{2}, std::vector<float>{0.5f, -0.25f}};
  asset.settings_json = "{\"iterations\":700}";
  return asset;
}

TEST_F(FieldAssetFile, GivesEverythingBackBitForBit) {
  const FieldAsset asset = smallAsset();
  writeFieldAsset(asset, path("a.stipple.safetensors"));
  EXPECT_EQ(readAssetKind(path("a.stipple.safetensors")), kAssetField);
  const FieldAsset seen = readFieldAsset(path("a.stipple.safetensors"));
  EXPECT_EQ(seen.root_origin, asset.root_origin);
  EXPECT_EQ(seen.root_side, asset.root_side);
  EXPECT_EQ(seen.cells, asset.cells);
  EXPECT_EQ(seen.log_probabilities, asset.log_probabilities);
  EXPECT_EQ(seen.field_level, asset.field_level);
  EXPECT_EQ(seen.gaussians, asset.gaussians);
  EXPECT_EQ(seen.sh_degree, asset.sh_degree);
  EXPECT_EQ(seen.least_anchors, asset.least_anchors);
  EXPECT_EQ(seen.most_anchors, asset.most_anchors);
  EXPECT_EQ(seen.jitter, asset.jitter);
  EXPECT_EQ(seen.contracted, asset.contracted);
  EXPECT_EQ(seen.nested, asset.nested);
  EXPECT_EQ(seen.seed, asset.seed);
  EXPECT_EQ(seen.colour_space, asset.colour_space);
  EXPECT_EQ(seen.antialias, asset.antialias);
  EXPECT_EQ(seen.settings_json, asset.settings_json);
  ASSERT_EQ(seen.tensors.size(), asset.tensors.size());
  for (const auto& [name, tensor] : asset.tensors) {
    EXPECT_EQ(seen.tensors.at(name).shape, tensor.shape);
    EXPECT_EQ(seen.tensors.at(name).values, tensor.values);
  }
}

TEST_F(FieldAssetFile, EveryTruncatedPrefixIsRefused) {
  writeFieldAsset(smallAsset(), path("a"));
  std::ifstream in(path("a"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  for (size_t size = 0; size < bytes.size(); size += 7) {
    std::ofstream(path("b"), std::ios::binary).write(bytes.data(), static_cast<long>(size));
    EXPECT_THROW(readFieldAsset(path("b")), Error) << size;
  }
}

TEST_F(FieldAssetFile, RefusesPartsThatAreNoField) {
  const auto messageOf = [&](const FieldAsset& asset) -> std::string {
    try {
      writeFieldAsset(asset, path("a"));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return error.what();
    }
    return "";
  };
  FieldAsset asset = smallAsset();
  asset.tensors["tree.leaves"] = {{1}, std::vector<float>{1}};
  EXPECT_THAT(messageOf(asset), ::testing::HasSubstr("tensor tree.leaves is not one of a field"));
  asset = smallAsset();
  asset.tensors["field.x"] = {{1}, std::vector<float>{NAN}};
  EXPECT_THAT(messageOf(asset), ::testing::HasSubstr("tensor field.x holds nan"));
  asset = smallAsset();
  asset.most_anchors = 7;
  EXPECT_THAT(messageOf(asset), ::testing::HasSubstr("budgets 100 to 7"));
  asset = smallAsset();
  asset.log_probabilities[1].pop_back();
  EXPECT_THAT(messageOf(asset), ::testing::HasSubstr("octree.log_p.1"));
  asset = smallAsset();
  asset.tensors.clear();
  EXPECT_THAT(messageOf(asset), ::testing::HasSubstr("no tensors of a field"));
}

TEST_F(FieldAssetFile, RefusesMetadataOutOfRange) {
  writeFieldAsset(smallAsset(), path("a"));
  std::ifstream in(path("a"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  const auto messageWith = [&](const std::string& from, const std::string& to) -> std::string {
    std::string changed = bytes;
    const size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);  // of the same length: offsets stay
    std::ofstream(path("b"), std::ios::binary) << changed;
    try {
      readFieldAsset(path("b"));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(messageWith("\"K\":\"16\"", "\"K\":\"99\""), ::testing::HasSubstr("K = 99; 4 to 32"));
  EXPECT_THAT(messageWith("\"sh_degree\":\"2\"", "\"sh_degree\":\"x\""),
              ::testing::HasSubstr("sh_degree = x"));
  EXPECT_THAT(messageWith("\"jitter\":\"none\"", "\"jitter\":\"some\""),
              ::testing::HasSubstr("'leaf' or 'none'"));
  EXPECT_THAT(messageWith("\"draws\":\"nested\"", "\"draws\":\"nestle\""),
              ::testing::HasSubstr("'nested' or 'any'"));
  EXPECT_THAT(messageWith("\"seed\":\"18446744073709551615\"", "\"seed\":\"-8446744073709551615\""),
              ::testing::HasSubstr("seed = -8446744073709551615; 0 to 18446744073709551615"));
}

}  // namespace
}  // namespace stipple
