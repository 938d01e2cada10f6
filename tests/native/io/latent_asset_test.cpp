#include "io/assets/latent_asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>

#include "io/bytes/sha256.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class LatentAssetFile : public ScratchFolder {};

LatentAsset smallAsset() {
  LatentAsset asset;
  asset.latent.token_count = 3;
  asset.latent.width = 2;
  asset.latent.tokens = {1, -2, 0.5f, 0, 3e-5f, 7};
  asset.latent.camera = {0.6f, 0, 0.8f, 0.25f, 0.5f};
  asset.weights = {"decoder.safetensors", 1234, std::string(64, 'a')};
  asset.settings_json = "{\"seed\":42}";
  return asset;
}

TEST_F(LatentAssetFile, GivesEverythingBackBitForBit) {
  const LatentAsset asset = smallAsset();
  writeLatentAsset(asset, path("a"));
  EXPECT_EQ(readAssetKind(path("a")), kAssetLatent);
  const LatentAsset seen = readLatentAsset(path("a"));
  EXPECT_EQ(seen.latent.token_count, 3u);
  EXPECT_EQ(seen.latent.width, 2u);
  EXPECT_EQ(seen.latent.tokens, asset.latent.tokens);
  EXPECT_EQ(seen.latent.camera, asset.latent.camera);
  EXPECT_EQ(seen.weights.name, asset.weights.name);
  EXPECT_EQ(seen.weights.bytes, asset.weights.bytes);
  EXPECT_EQ(seen.weights.sha256, asset.weights.sha256);
  EXPECT_EQ(seen.settings_json, asset.settings_json);
}

TEST_F(LatentAssetFile, RefusesWhatIsNoLatent) {
  const auto expectRefused = [&](const char* text,
                                 const std::function<void(LatentAsset&)>& change) {
    LatentAsset asset = smallAsset();
    change(asset);
    expectError(ErrorCode::kInvalidArgument, {text}, [&] { writeLatentAsset(asset, path("b")); });
    EXPECT_FALSE(std::filesystem::exists(path("b")));
  };
  expectRefused("4 tokens of 2", [](LatentAsset& asset) { asset.latent.token_count = 4; });
  expectRefused("0 tokens", [](LatentAsset& asset) {
    asset.latent.token_count = 0;
    asset.latent.tokens.clear();
  });
  expectRefused("latent.tokens holds nan", [](LatentAsset& asset) {
    asset.latent.tokens[5] = std::numeric_limits<float>::quiet_NaN();
  });
  expectRefused("latent.camera holds inf",
                [](LatentAsset& asset) { asset.latent.camera[4] = HUGE_VALF; });
  for (const char* name : {"", "..", "a/b", "/etc/passwd", "a\\b"}) {
    expectRefused("a file name without folders is needed",
                  [&](LatentAsset& asset) { asset.weights.name = name; });
  }
  expectRefused("0 bytes", [](LatentAsset& asset) { asset.weights.bytes = 0; });
  expectRefused("64 hexadecimal digits",
                [](LatentAsset& asset) { asset.weights.sha256 = std::string(64, 'A'); });
}

TEST_F(LatentAssetFile, RefusesFilesThatLie) {
  writeLatentAsset(smallAsset(), path("a"));
  const std::string bytes = load(path("a"));
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = bytes;
    EXPECT_EQ(from.size(), to.size());
    other.replace(other.find(from), from.size(), to);
    return store("b", other);
  };
  expectError(ErrorCode::kFormat, {"weights_bytes", "12x4"},
              [&] { readLatentAsset(changed("\"1234\"", "\"12x4\"")); });
  expectError(ErrorCode::kFormat, {"file name without folders"},
              [&] { readLatentAsset(changed("decoder.safe", "../odr./safe")); });
  expectError(ErrorCode::kFormat, {"'weights_sha256'"},
              [&] { readLatentAsset(changed("weights_sha256", "weights_sha257")); });
  expectError(ErrorCode::kFormat, {"latent.tokens"},
              [&] { readLatentAsset(changed("latent.tokens", "latent.tokenz")); });
  expectError(ErrorCode::kUnsupported, {"'latent' is needed"},
              [&] { readLatentAsset(changed("\"kind\":\"latent\"", "\"kind\":\"patent\"")); });
  for (size_t size = 0; size < bytes.size(); size += 7) {
    store("b", bytes.substr(0, size));
    EXPECT_THROW(readLatentAsset(path("b")), Error) << size;
  }
}

class WeightsReferences : public ScratchFolder {};

TEST_F(WeightsReferences, AreFoundByContentAloneWhereNamesAndSizesDeceive) {
  std::filesystem::create_directories(folder_ / "below");
  const std::string file = store("one.safetensors", "the weights");
  const WeightsReference weights = referenceOf(file);
  EXPECT_EQ(weights.name, "one.safetensors");
  EXPECT_EQ(weights.bytes, 11u);
  EXPECT_EQ(weights.sha256, sha256OfFile(file));
  std::filesystem::rename(file, folder_ / "below" / "two.safetensors");
  store("one.safetensors", "the Weights");
  const std::vector<std::string> one = {folder_.string()};
  EXPECT_EQ(findReferenced(weights, one, "it"), path("below/two.safetensors"));
  std::filesystem::create_directories(folder_ / "empty");
  const std::vector<std::string> two = {path("empty"), path("below")};
  EXPECT_EQ(findReferenced(weights, two, "it"), path("below/two.safetensors"));
  std::filesystem::remove(folder_ / "below" / "two.safetensors");
  expectError(ErrorCode::kUnavailable,
              {"it needs the weights one.safetensors (11 bytes", "does not have",
               "one.safetensors is another file"},
              [&] { findReferenced(weights, one, "it"); });
  expectError(ErrorCode::kUnavailable, {"empty' and '", "do not have"},
              [&] { findReferenced(weights, two, "it"); });
  expectError(ErrorCode::kUnavailable, {"no folder of weights is set"},
              [&] { findReferenced(weights, {}, "it"); });
}

}  // namespace
}  // namespace stipple
