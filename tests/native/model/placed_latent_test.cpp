#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "io/assets/latent_asset.h"
#include "io/scratch_folder.h"
#include "model/model_kinds.h"
#include "small_latent.h"

namespace stipple {
namespace {

class PlacedLatent : public ScratchFolder {
 protected:
  void SetUp() override {
    ScratchFolder::SetUp();
    weights_ = path("weights");
    std::filesystem::create_directories(weights_);
    test::smallLatent(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors", weights_)
        ->save(path("plain.stipple.safetensors"));
    asset_ = readLatentAsset(path("plain.stipple.safetensors"));
  }
  SplatCloud decoded() const {
    writeLatentAsset(asset_, path("placed.stipple.safetensors"));
    ModelRequest request;
    request.budget = 40;
    return loadModel(path("placed.stipple.safetensors"), {{weights_}, nullptr})->decode(request);
  }

  std::string weights_;
  LatentAsset asset_;
};

TEST_F(PlacedLatent, DecodesToTheSameSplatsElsewhere) {
  const SplatCloud plain = decoded();
  asset_.latent.placement = {2.0, {1.0, -0.5, 0.25}};
  const SplatCloud placed = decoded();
  ASSERT_EQ(placed.size(), plain.size());
  for (size_t i = 0; i < 3 * plain.size(); ++i) {
    const double offset = asset_.latent.placement.offset[i % 3];
    // One rounding to float32 of a number below 4.
    EXPECT_NEAR(placed.positions[i], 2.0 * static_cast<double>(plain.positions[i]) + offset, 3e-7);
    EXPECT_EQ(placed.scales[i], 2 * plain.scales[i]);
  }
  EXPECT_EQ(placed.rotations, plain.rotations);
  EXPECT_EQ(placed.sh, plain.sh);
}

TEST_F(PlacedLatent, TellsWhereItsCubeIs) {
  asset_.latent.placement = {2.0, {1.0, -0.5, 0.25}};
  writeLatentAsset(asset_, path("placed.stipple.safetensors"));
  const auto model = loadModel(path("placed.stipple.safetensors"), {{weights_}, nullptr});
  EXPECT_EQ(model->info().bounds_min, (std::array<float, 3>{0.0f, -1.5f, -0.75f}));
  EXPECT_EQ(model->info().bounds_max, (std::array<float, 3>{2.0f, 0.5f, 1.25f}));
  EXPECT_EQ(model->density()->root().side, 2.0);
}

TEST_F(PlacedLatent, IsStoredToTheBit) {
  asset_.latent.placement = {1.0 / 3.0, {0.1, 0.2, 0.3}};
  writeLatentAsset(asset_, path("placed.stipple.safetensors"));
  const LatentAsset seen = readLatentAsset(path("placed.stipple.safetensors"));
  EXPECT_EQ(seen.latent.placement.scale, asset_.latent.placement.scale);
  EXPECT_EQ(seen.latent.placement.offset, asset_.latent.placement.offset);
  EXPECT_TRUE(seen.extras.tensors.empty());
}

TEST_F(PlacedLatent, RefusesPlacesWhereNothingStands) {
  asset_.latent.placement.scale = 0;
  expectError(ErrorCode::kInvalidArgument, {"latent.placement"},
              [&] { writeLatentAsset(asset_, path("wrong.stipple.safetensors")); });
  asset_.latent.placement = {1.0, {0.0, HUGE_VAL, 0.0}};
  expectError(ErrorCode::kInvalidArgument, {"latent.placement"},
              [&] { writeLatentAsset(asset_, path("wrong.stipple.safetensors")); });
}

}  // namespace
}  // namespace stipple
