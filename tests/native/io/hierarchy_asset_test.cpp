#include "io/assets/hierarchy_asset.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "base/error.h"
#include "io/assets/asset_header.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class HierarchyAssetFile : public ScratchFolder {};

SplatCloud randomSplats(size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  SplatCloud cloud;
  cloud.sh_degree = 2;
  cloud.colour_space = ColourSpace::kLinear;
  cloud.antialias = Antialias::kMip;
  cloud.frame = Frame::kRUB;
  cloud.resize(count);
  for (auto* values :
       {&cloud.positions, &cloud.rotations, &cloud.scales, &cloud.opacities, &cloud.sh}) {
    for (float& value : *values) value = unit(random);
  }
  return cloud;
}

HierarchyAsset smallAsset() {
  HierarchyAsset asset;
  asset.leaves = randomSplats(3, 1);
  asset.nodes = randomSplats(2, 2);
  asset.parents = {0xffffffffu, 0, 0, 1, 1};
  asset.errors = {0.5f, 0.25f};
  asset.settings_json = "{\"views\":16}";
  return asset;
}

TEST_F(HierarchyAssetFile, GivesEverythingBackBitForBit) {
  const HierarchyAsset asset = smallAsset();
  writeHierarchyAsset(asset, path("a.stipple.safetensors"));
  EXPECT_EQ(readAssetKind(path("a.stipple.safetensors")), kAssetHierarchy);
  const HierarchyAsset seen = readHierarchyAsset(path("a.stipple.safetensors"));
  for (const auto& [a, b] :
       {std::pair(&seen.leaves, &asset.leaves), std::pair(&seen.nodes, &asset.nodes)}) {
    EXPECT_EQ(a->positions, b->positions);
    EXPECT_EQ(a->rotations, b->rotations);
    EXPECT_EQ(a->scales, b->scales);
    EXPECT_EQ(a->opacities, b->opacities);
    EXPECT_EQ(a->sh, b->sh);
    EXPECT_EQ(a->sh_degree, b->sh_degree);
    EXPECT_EQ(a->colour_space, b->colour_space);
    EXPECT_EQ(a->antialias, b->antialias);
    EXPECT_EQ(a->frame, b->frame);
  }
  EXPECT_EQ(seen.parents, asset.parents);
  EXPECT_EQ(seen.errors, asset.errors);
  EXPECT_EQ(seen.settings_json, asset.settings_json);
}

TEST_F(HierarchyAssetFile, EveryTruncatedPrefixIsRefused) {
  writeHierarchyAsset(smallAsset(), path("a.stipple.safetensors"));
  std::ifstream in(path("a.stipple.safetensors"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  for (size_t length = 0; length < bytes.size(); length += 1 + length / 40) {
    EXPECT_THROW(readHierarchyAsset(store("cut.safetensors", bytes.substr(0, length))), Error)
        << length;
  }
}

TEST_F(HierarchyAssetFile, RefusesPartsThatDoNotFit) {
  const auto refused = [&](const HierarchyAsset& asset) {
    EXPECT_THROW(writeHierarchyAsset(asset, path("never.safetensors")), Error);
    EXPECT_FALSE(std::ifstream(path("never.safetensors")).good());
  };
  HierarchyAsset asset = smallAsset();
  asset.parents.pop_back();
  refused(asset);
  asset = smallAsset();
  asset.errors.push_back(0);
  refused(asset);
  asset = smallAsset();
  asset.nodes = randomSplats(3, 3);
  refused(asset);
  asset = smallAsset();
  asset.leaves.opacities[1] = 2;
  refused(asset);
  asset = smallAsset();
  asset.leaves.resize(0);
  refused(asset);
}

}  // namespace
}  // namespace stipple
