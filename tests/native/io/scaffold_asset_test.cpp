#include "io/assets/scaffold_asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/error.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class ScaffoldAssetFile : public ScratchFolder {};

ScaffoldAsset smallAsset() {
  ScaffoldAsset asset;
  asset.gaussians = 7;
  asset.sh_degree = 2;
  asset.colour_space = ColourSpace::kLinear;
  asset.antialias = Antialias::kMip;
  asset.tensors["scaffold.positions"] = {{2, 3}, std::vector<float>{1, 2, 3, 4, 5, 6}};
  asset.coarsening_percent = 50;
  asset.settings_json = "{\"iterations\":700}";
  return asset;
}

TEST_F(ScaffoldAssetFile, GivesEverythingBackBitForBit) {
  const ScaffoldAsset asset = smallAsset();
  writeScaffoldAsset(asset, path("a.stipple.safetensors"));
  EXPECT_EQ(readAssetKind(path("a.stipple.safetensors")), kAssetScaffold);
  const ScaffoldAsset seen = readScaffoldAsset(path("a.stipple.safetensors"));
  EXPECT_EQ(seen.gaussians, asset.gaussians);
  EXPECT_EQ(seen.sh_degree, asset.sh_degree);
  EXPECT_EQ(seen.colour_space, asset.colour_space);
  EXPECT_EQ(seen.antialias, asset.antialias);
  EXPECT_EQ(seen.coarsening_percent, asset.coarsening_percent);
  EXPECT_EQ(seen.settings_json, asset.settings_json);
  ASSERT_EQ(seen.tensors.size(), 1u);
  EXPECT_EQ(seen.tensors.at("scaffold.positions").values,
            asset.tensors.at("scaffold.positions").values);
}

TEST_F(ScaffoldAssetFile, KeepsWhatItDoesNotKnow) {
  const ScaffoldAsset asset = smallAsset();
  writeScaffoldAsset(asset, path("a.stipple.safetensors"));
  ScaffoldAsset seen = readScaffoldAsset(path("a.stipple.safetensors"));
  seen.extras.metadata["author"] = "somebody";
  writeScaffoldAsset(seen, path("b.stipple.safetensors"));
  EXPECT_EQ(readScaffoldAsset(path("b.stipple.safetensors")).extras.metadata.at("author"),
            "somebody");
}

TEST_F(ScaffoldAssetFile, RefusesNumbersThatAreNotFiniteAndNamesOfOthers) {
  ScaffoldAsset asset = smallAsset();
  asset.tensors["scaffold.positions"].values = std::vector<float>{1, 2, NAN, 4, 5, 6};
  expectError(ErrorCode::kInvalidArgument, {"scaffold.positions", "finite"},
              [&] { writeScaffoldAsset(asset, path("a")); });
  asset = smallAsset();
  asset.tensors["field.positions"] = {{1}, std::vector<float>{1}};
  expectError(ErrorCode::kInvalidArgument, {"field.positions", "'scaffold.'"},
              [&] { writeScaffoldAsset(asset, path("a")); });
  asset.tensors.clear();
  expectError(ErrorCode::kInvalidArgument, {"no tensors of a scaffold"},
              [&] { writeScaffoldAsset(asset, path("a")); });
}

}  // namespace
}  // namespace stipple
