// Asset files of every version that was ever written, which must stay readable. Their numbers come
// from the formulas of tests/data/assets/make_assets.py, not from our writer.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "io/assets/field_asset.h"
#include "io/assets/hierarchy_asset.h"
#include "io/assets/latent_asset.h"
#include "io/assets/motion_asset.h"
#include "io/assets/relay_asset.h"
#include "io/assets/scaffold_asset.h"
#include "io/assets/surface_asset.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class GoldenAssets : public ScratchFolder {
 protected:
  static std::string golden(const std::string& name) {
    return STIPPLE_TEST_DATA "/assets/" + name + ".stipple.safetensors";
  }
};

/// (first + 3 row + column) / 64: exact in float32.
std::vector<float> numbers(size_t rows, size_t width, int first) {
  std::vector<float> values;
  for (size_t row = 0; row < rows; ++row) {
    for (size_t column = 0; column < width; ++column) {
      values.push_back((static_cast<float>(first) + static_cast<float>(3 * row + column)) / 64.0f);
    }
  }
  return values;
}

void expectLogarithms(const std::vector<float>& seen, const std::vector<double>& probabilities) {
  ASSERT_EQ(seen.size(), probabilities.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    if (probabilities[i] == 0) {
      EXPECT_EQ(seen[i], -HUGE_VALF);
    } else {
      // The file was written with another library's logarithm: one step of float32 at -2.08.
      EXPECT_NEAR(seen[i], std::log(probabilities[i]), 2.4e-7);
    }
  }
}

/// What the golden files hold beside the parts of their models.
void expectExtras(const AssetExtras& extras) {
  EXPECT_EQ(extras.metadata.at("provenance"), "written by hand");
  ASSERT_EQ(extras.tensors.size(), 1u);
  const CarriedTensor& labels = extras.tensors.at("future.labels");
  EXPECT_EQ(labels.dtype, "I16");
  EXPECT_EQ(labels.shape, (std::vector<uint64_t>{2, 2}));
  EXPECT_EQ(labels.bytes, (std::vector<uint8_t>{1, 0, 0xfe, 0xff, 0x2c, 1, 4, 0}));
}

void expectOctree(const OctreeTensors& asset) {
  EXPECT_EQ(asset.root_origin, (std::array<double, 3>{-1.5, 0.25, 2.0}));
  EXPECT_EQ(asset.root_side, 4.0);
  EXPECT_EQ(asset.cells, (std::vector<std::vector<uint64_t>>{{0}, {0, 5, 7}}));
  ASSERT_EQ(asset.log_probabilities.size(), 2u);
  expectLogarithms(asset.log_probabilities[0], {0.5, 0, 0, 0, 0, 0.25, 0, 0.25});
  const double e = 0.125;
  expectLogarithms(asset.log_probabilities[1],
                   {e, e, e, e, e, e, e, e, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.5, 0.5, 0, 0, 0});
}

void expectField(const FieldAsset& asset) {
  expectOctree(asset);
  EXPECT_EQ(asset.field_level, 7);
  EXPECT_EQ(asset.gaussians, 16u);
  EXPECT_EQ(asset.sh_degree, 2);
  EXPECT_EQ(asset.least_anchors, 100u);
  EXPECT_EQ(asset.most_anchors, 5000u);
  EXPECT_FALSE(asset.jitter);
  EXPECT_FALSE(asset.nested);
  EXPECT_EQ(asset.colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(asset.antialias, Antialias::kClassic);
  const auto expectTensor = [&](const char* name, std::vector<uint64_t> shape,
                                const std::vector<float>& values) {
    EXPECT_EQ(asset.tensors.at(name).shape, shape);
    EXPECT_EQ(std::get<std::vector<float>>(asset.tensors.at(name).values), values);
  };
  EXPECT_EQ(asset.tensors.size(), 4u);
  expectTensor("field.features.level3", {8, 8}, numbers(8, 8, 1));
  expectTensor("field.colours.level7", {16, 3}, numbers(16, 3, 2));
  expectTensor("field.network.layer0.weights", {16, 64}, numbers(16, 64, 3));
  expectTensor("field.network.layer0.biases", {64}, numbers(64, 1, 4));
  EXPECT_EQ(asset.settings_json, "{\"iterations\": 700}");
  expectExtras(asset.extras);
}

void expectSurface(const SurfaceAsset& asset) {
  expectOctree(asset);
  EXPECT_EQ(asset.surface.positions, numbers(5, 3, 1));
  EXPECT_EQ(asset.surface.normals,
            (std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}));
  EXPECT_EQ(asset.surface.colours, numbers(5, 3, 2));
  EXPECT_EQ(asset.surface.opacities, numbers(5, 1, 10));
  EXPECT_EQ(asset.surface.areas, numbers(5, 1, 20));
  EXPECT_EQ(asset.surface.weights, numbers(5, 1, 30));
  EXPECT_EQ(asset.settings_json, "{\"detail\": 0.5}");
  expectExtras(asset.extras);
}

void expectSplats(const SplatCloud& cloud, size_t rows, int first) {
  EXPECT_EQ(cloud.sh_degree, 1);
  EXPECT_EQ(cloud.colour_space, ColourSpace::kDisplay);
  EXPECT_EQ(cloud.antialias, Antialias::kMip);
  EXPECT_EQ(cloud.frame, Frame::kRUB);
  EXPECT_EQ(cloud.positions, numbers(rows, 3, first));
  ASSERT_EQ(cloud.rotations.size(), rows * 4);
  for (size_t i = 0; i < rows * 4; ++i) EXPECT_EQ(cloud.rotations[i], i % 4 == 1 ? 1.0f : 0.0f);
  EXPECT_EQ(cloud.scales, numbers(rows, 3, first + 7));
  EXPECT_EQ(cloud.opacities, numbers(rows, 1, 20));
  EXPECT_EQ(cloud.sh, numbers(rows, 12, first + 13));
}

void expectHierarchy(const HierarchyAsset& asset) {
  expectSplats(asset.leaves, 4, 1);
  expectSplats(asset.nodes, 3, 101);
  EXPECT_EQ(asset.parents, (std::vector<uint32_t>{UINT32_MAX, 0, 0, 1, 1, 2, 2}));
  EXPECT_EQ(asset.errors, (std::vector<float>{0.75f, 0.5f, 0.25f}));
  EXPECT_EQ(asset.settings_json, "{\"views\": 16}");
  expectExtras(asset.extras);
}

TEST_F(GoldenAssets, ReadsASurfaceOfVersion1AndKeepsAllOfIt) {
  const SurfaceAsset asset = readSurfaceAsset(golden("surface_1.0"));
  expectSurface(asset);
  writeSurfaceAsset(asset, path("again"));
  expectSurface(readSurfaceAsset(path("again")));
}

TEST_F(GoldenAssets, ReadsAHierarchyOfVersion1AndKeepsAllOfIt) {
  const HierarchyAsset asset = readHierarchyAsset(golden("hierarchy_1.0"));
  expectHierarchy(asset);
  writeHierarchyAsset(asset, path("again"));
  expectHierarchy(readHierarchyAsset(path("again")));
}

TEST_F(GoldenAssets, ReadsAFieldOfVersion1AndKeepsAllOfIt) {
  const FieldAsset asset = readFieldAsset(golden("field_1.0"));
  expectField(asset);
  writeFieldAsset(asset, path("again"));
  expectField(readFieldAsset(path("again")));
}

void expectLatent(const LatentAsset& asset) {
  EXPECT_EQ(asset.latent.token_count, 6u);
  EXPECT_EQ(asset.latent.width, 4u);
  EXPECT_EQ(asset.latent.tokens, numbers(6, 4, 1));
  EXPECT_EQ(std::vector<float>(asset.latent.camera.begin(), asset.latent.camera.end()),
            numbers(5, 1, 2));
  EXPECT_EQ(asset.weights.name, "decoder.safetensors");
  EXPECT_EQ(asset.weights.bytes, 576148442u);
  EXPECT_EQ(asset.weights.sha256,
            "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef");
  EXPECT_EQ(asset.settings_json, "{\"seed\": 42}");
  expectExtras(asset.extras);
}

TEST_F(GoldenAssets, ReadsALatentOfVersion1AndKeepsAllOfIt) {
  const LatentAsset asset = readLatentAsset(golden("latent_1.0"));
  expectLatent(asset);
  writeLatentAsset(asset, path("again"));
  expectLatent(readLatentAsset(path("again")));
}

void expectMovingSplats(const MotionTensors& tensors, size_t rows, int first) {
  expectSplats(tensors.splats, rows, first);
  for (size_t harmonic = 1; harmonic <= 4; ++harmonic) {
    const int at = first + 29 + static_cast<int>(harmonic);
    EXPECT_EQ(tensors.waves[2 * harmonic - 2], numbers(rows, 3, at));
    EXPECT_EQ(tensors.waves[2 * harmonic - 1], numbers(rows, 3, at + 10));
  }
  EXPECT_EQ(tensors.phases, numbers(rows, 4, first + 2));
  EXPECT_EQ(tensors.spins, numbers(rows, 4, first + 3));
  EXPECT_EQ(tensors.lifespans, numbers(rows, 2, 5));
  EXPECT_EQ(tensors.centres, numbers(rows, 1, 6));
}

void expectMotion(const MotionAsset& asset) {
  expectMovingSplats(asset, 3, 1);
  EXPECT_EQ(asset.begin, 0.5);
  EXPECT_EQ(asset.frame_count, 9u);
  EXPECT_EQ(asset.frames_per_second, 4);
  EXPECT_EQ(asset.window_frames, 50);
  EXPECT_EQ(asset.window_share, 0.75);
  EXPECT_NE(asset.settings_json.find("42"), std::string::npos);
  expectExtras(asset.extras);
}

TEST_F(GoldenAssets, ReadsMovingSplatsOfVersion1AndKeepsAllOfThem) {
  const MotionAsset asset = readMotionAsset(golden("motion_1.0"));
  expectMotion(asset);
  EXPECT_TRUE(asset.parents.empty());
  writeMotionAsset(asset, path("again"));
  expectMotion(readMotionAsset(path("again")));
}

TEST_F(GoldenAssets, ReadsMovingSplatsWithATreeAndKeepsAllOfThem) {
  MotionAsset asset = readMotionAsset(golden("motion_tree_1.0"));
  for (int time = 0; time < 2; ++time) {
    expectMotion(asset);
    expectMovingSplats(asset.nodes, 2, 101);
    EXPECT_EQ(asset.parents, (std::vector<uint32_t>{UINT32_MAX, 0, 0, 1, 1}));
    EXPECT_EQ(asset.errors, (std::vector<float>{0.75f, 0.5f}));
    writeMotionAsset(asset, path("again"));
    asset = readMotionAsset(path("again"));
  }
}

TEST_F(GoldenAssets, ReadsAnchorsWithFeaturesOfVersion1AndKeepsAllOfThem) {
  ScaffoldAsset asset = readScaffoldAsset(golden("scaffold_1.0"));
  for (int time = 0; time < 2; ++time) {
    EXPECT_EQ(asset.gaussians, 2u);
    EXPECT_EQ(asset.sh_degree, 1);
    EXPECT_EQ(asset.colour_space, ColourSpace::kDisplay);
    EXPECT_EQ(asset.antialias, Antialias::kMip);
    const auto valuesOf = [&](const char* name) {
      return std::get<std::vector<float>>(asset.tensors.at(name).values);
    };
    EXPECT_EQ(valuesOf("scaffold.positions"), numbers(3, 3, 1));
    EXPECT_EQ(valuesOf("scaffold.features"), numbers(3, 32, 2));
    EXPECT_EQ(valuesOf("scaffold.log_scales"), numbers(3, 6, 3));
    EXPECT_EQ(valuesOf("scaffold.offsets"), numbers(3, 6, 4));
    EXPECT_EQ(valuesOf("scaffold.colour.layer1.weights"), numbers(32, 24, -46));
    EXPECT_EQ(asset.tensors.size(), 4u + 3 * 4);
    expectExtras(asset.extras);
    writeScaffoldAsset(asset, path("again"));
    asset = readScaffoldAsset(path("again"));
  }
}

TEST_F(GoldenAssets, ReadsKeyFramesOfVersion1AndKeepsAllOfThem) {
  std::string file = golden("relay_1.0");
  for (int time = 0; time < 2; ++time) {
    const RelayAsset asset(file);
    const RelayAssetHead& head = asset.head();
    EXPECT_EQ(head.begin, 0.5);
    EXPECT_EQ(head.frames_per_second, 4);
    EXPECT_EQ(head.frame_count, 9u);
    EXPECT_EQ(head.spacing, 4u);
    EXPECT_EQ(head.blend, 3u);
    EXPECT_EQ(head.gaussians, 2u);
    EXPECT_EQ(head.sh_degree, 1);
    EXPECT_EQ(head.anchor_counts, (std::vector<uint64_t>{3, 2}));
    EXPECT_EQ(head.bounds, (std::array<double, 6>{-1.5, 0.25, 0, 2, 3, 4}));
    expectExtras(head.extras);
    const TensorTable first = asset.key(0);
    const TensorTable second = asset.key(1);
    const auto floatsOf = [](const TensorTable& table, const char* name) {
      return std::get<std::vector<float>>(table.at(name).values);
    };
    EXPECT_EQ(floatsOf(first, "scaffold.positions"), numbers(3, 3, 1));
    EXPECT_EQ(floatsOf(second, "scaffold.positions"), numbers(2, 3, 11));
    EXPECT_EQ(floatsOf(second, "blend"), numbers(2, 4, 6));
    EXPECT_EQ(floatsOf(first, "planes.6"), numbers(16, 2, 6));
    EXPECT_EQ(first.at("planes.8").shape, (std::vector<uint64_t>{4, 4, 2}));
    EXPECT_EQ(std::get<std::vector<double>>(first.at("box").values).size(), 7u);
    EXPECT_EQ(floatsOf(first, "heads.layer2.weights"), numbers(64, 47, -94));
    EXPECT_EQ(std::get<std::vector<double>>(second.at("coarsening").values),
              std::vector<double>{0.5});
    EXPECT_EQ(first.size(), 4u + 3 * 4 + 3 + 12 + 6);
    EXPECT_EQ(second.size(), 4u + 3 * 4 + 2);
    writeRelayAsset(
        head, [&](uint32_t key) { return asset.key(key); }, path("again"));
    file = path("again");
  }
}

TEST_F(GoldenAssets, ReadsAFieldThatSaysHowItsAnchorsAreDrawn) {
  FieldAsset asset = readFieldAsset(golden("whole_field_1.0"));
  for (int time = 0; time < 2; ++time) {
    EXPECT_EQ(asset.gaussians, 4u);
    EXPECT_EQ(asset.sh_degree, 0);
    EXPECT_TRUE(asset.jitter);
    EXPECT_TRUE(asset.nested);
    EXPECT_EQ(asset.seed, 77u);
    EXPECT_EQ(std::get<std::vector<float>>(asset.tensors.at("field.features.level3").values),
              numbers(8, 8, 1));
    EXPECT_EQ(asset.tensors.at("field.details.level5").shape, (std::vector<uint64_t>{16, 8}));
    EXPECT_EQ(asset.tensors.at("field.network.layer0.weights").shape,
              (std::vector<uint64_t>{32, 64}));
    writeFieldAsset(asset, path("again"));
    asset = readFieldAsset(path("again"));
  }
}

TEST_F(GoldenAssets, KeepsTheVersionOfANewerFileAndRefusesTheNextMajorOne) {
  const auto withVersion = [&](const char* name, const std::string& version) {
    std::string bytes = load(golden(name));
    bytes.replace(bytes.find("\"1.0\""), 5, version);
    return store(name, bytes);
  };
  writeHierarchyAsset(readHierarchyAsset(withVersion("hierarchy_1.0", "\"1.7\"")), path("a"));
  EXPECT_NE(load(path("a")).find("\"stipple_version\":\"1.7\""), std::string::npos);
  writeSurfaceAsset(readSurfaceAsset(withVersion("surface_1.0", "\"1.7\"")), path("a"));
  EXPECT_NE(load(path("a")).find("\"stipple_version\":\"1.7\""), std::string::npos);
  expectError(ErrorCode::kUnsupported, {"hierarchy_1.0", "version 2", "version 1"},
              [&] { readHierarchyAsset(withVersion("hierarchy_1.0", "\"2.0\"")); });
  expectError(ErrorCode::kUnsupported, {"surface_1.0", "version 2", "version 1"},
              [&] { readSurfaceAsset(withVersion("surface_1.0", "\"2.0\"")); });
}

TEST_F(GoldenAssets, WhatIsKeptNeverReplacesWhatIsKnown) {
  HierarchyAsset asset = readHierarchyAsset(golden("hierarchy_1.0"));
  asset.errors = {3, 2, 1};
  asset.leaves.frame = asset.nodes.frame = Frame::kRDF;
  asset.extras.tensors["tree.errors"] = {"F32", {0}, {}};
  writeHierarchyAsset(asset, path("a"));
  const HierarchyAsset back = readHierarchyAsset(path("a"));
  EXPECT_EQ(back.errors, asset.errors);
  EXPECT_EQ(back.leaves.frame, Frame::kRDF);
}

}  // namespace
}  // namespace stipple
