#include "model/latent_splats.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "decode/latent/latent_decoder.h"
#include "io/assets/latent_asset.h"
#include "io/scratch_folder.h"
#include "model/model_kinds.h"
#include "small_latent.h"

namespace stipple {
namespace {

namespace fs = std::filesystem;

class LatentSplats : public ScratchFolder {
 protected:
  void SetUp() override {
    ScratchFolder::SetUp();
    weights_ = path("weights");
    fs::create_directories(weights_);
    model_ = test::smallLatent(STIPPLE_TEST_DATA "/networks/deg_pipeline_a.safetensors", weights_);
    asset_ = path("thing.stipple.safetensors");
    model_->save(asset_);
  }

  std::string weights_;
  std::string asset_;
  std::shared_ptr<const SplatModel> model_;
};

TEST_F(LatentSplats, HaveBudgetsOfAThousandToAMillionSplatsAndSayWhatWasLearned) {
  const ModelSettings settings = model_->settings();
  EXPECT_EQ(settings.budget_unit, BudgetUnit::kAnchors);
  EXPECT_EQ(settings.minimum_budget, 32u);
  EXPECT_EQ(settings.maximum_budget, 31250u);
  EXPECT_EQ(settings.minimum_learned_budget * 32, 32768u);
  EXPECT_EQ(settings.maximum_learned_budget * 32, 262144u);
  EXPECT_EQ(settings.default_gaussians_per_anchor, 32u);
  EXPECT_TRUE(settings.has_order && settings.has_seed);
  ModelRequest request;
  for (const uint64_t budget : {uint64_t{0}, uint64_t{31}, uint64_t{31251}, kMaxAnchorCount}) {
    request.budget = budget;
    expectError(ErrorCode::kInvalidArgument, {"anchors; 32 to 31250 is allowed"},
                [&] { model_->decode(request); });
  }
  request.budget = 32;
  EXPECT_EQ(model_->decode(request).size(), 1024u);
}

TEST_F(LatentSplats, OfAnotherSeedOrOrderAreOthers) {
  ModelRequest request;
  request.budget = 100;
  const SplatCloud first = model_->decode(request);
  request.seed = 1;
  EXPECT_NE(model_->decode(request).positions, first.positions);
  request.seed = 0;
  request.order = AnchorOrder::kProgressive;
  EXPECT_NE(model_->decode(request).positions, first.positions);
}

TEST_F(LatentSplats, AreStoredWithoutTheirWeights) {
  EXPECT_LT(fs::file_size(asset_), fs::file_size(weights_ + "/decoder.safetensors") / 20);
  const LatentAsset asset = readLatentAsset(asset_);
  EXPECT_EQ(asset.weights.name, "decoder.safetensors");
  EXPECT_EQ(asset.weights.bytes, fs::file_size(weights_ + "/decoder.safetensors"));
  EXPECT_EQ(asset.settings_json, "{\"seed\":42}");
  EXPECT_EQ(asset.latent.camera[3], 0.5f);
}

TEST_F(LatentSplats, FindTheirWeightsUnderAnyNameInAnySubfolder) {
  fs::create_directories(weights_ + "/deep/er");
  fs::rename(weights_ + "/decoder.safetensors", weights_ + "/deep/er/other.safetensors");
  const auto again = loadModel(asset_, {{weights_}, nullptr});
  ModelRequest request;
  request.budget = 64;
  EXPECT_EQ(again->decode(request).positions, model_->decode(request).positions);
}

TEST_F(LatentSplats, SayWhichWeightsAreMissingAndWhere) {
  expectError(ErrorCode::kUnavailable,
              {"thing.stipple.safetensors", "decoder.safetensors", "no folder of weights is set",
               "STIPPLE_WEIGHTS"},
              [&] { loadModel(asset_); });
  fs::remove(weights_ + "/decoder.safetensors");
  expectError(
      ErrorCode::kUnavailable,
      {"thing.stipple.safetensors", "decoder.safetensors", weights_.c_str(), "does not have"}, [&] {
        loadModel(asset_, {{weights_}, nullptr});
      });
  // Other weights of the same name.
  fs::copy_file(weights_ + "/flow.safetensors", weights_ + "/decoder.safetensors");
  expectError(ErrorCode::kUnavailable, {"does not have", "is another file"}, [&] {
    loadModel(asset_, {{weights_}, nullptr});
  });
  expectError(ErrorCode::kIo, {"/no/such/folder"}, [&] {
    loadModel(asset_, {{"/no/such/folder"}, nullptr});
  });
}

TEST_F(LatentSplats, RefuseWeightsWhoseContentDiffersByOneByte) {
  std::string bytes = load(weights_ + "/decoder.safetensors");
  bytes.back() = static_cast<char>(bytes.back() ^ 1);
  std::ofstream(weights_ + "/decoder.safetensors", std::ios::binary) << bytes;
  expectError(ErrorCode::kUnavailable, {"is another file"}, [&] {
    loadModel(asset_, {{weights_}, nullptr});
  });
}

TEST_F(LatentSplats, StopReadingWhenCancelled) {
  // In a file that nobody has hashed yet.
  fs::copy_file(weights_ + "/decoder.safetensors", weights_ + "/copy.safetensors");
  fs::remove(weights_ + "/decoder.safetensors");
  Progress progress;
  progress.cancel();
  expectError(ErrorCode::kCancelled, {}, [&] { loadModel(asset_, {{weights_}, &progress}); });
}

TEST_F(LatentSplats, TellAsMuchProgressOfTheDensityAsOfTheSplats) {
  Progress progress;
  ModelRequest request;
  request.budget = 32;
  model_->decode(request, &progress);
  EXPECT_EQ(progress.fraction(), 1.0);
  EXPECT_EQ(progress.stage(), "Decoding splats");
}

}  // namespace
}  // namespace stipple
