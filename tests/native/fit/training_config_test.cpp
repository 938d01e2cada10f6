#include "fit/training/training_config.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace stipple {
namespace {

TrainingConfig parsed(const char* text) {
  static const std::string kName = "config.json", kFolder = "/home/someone";
  return parseTrainingConfig(text, kName, kFolder);
}

TEST(TrainingConfig, TakesWhatIsSaidAndTheUsualForTheRest) {
  const TrainingConfig usual = defaultTrainingConfig();
  const TrainingConfig config =
      parsed(R"({"collection": "props", "out": "/elsewhere/out", "seed": 7,
                 "network": {"heads": 2},
                 "parts": [{"stage": "joint", "batch": 3, "weights": {"ssim": 0.4}}]})");
  EXPECT_EQ(config.collection, "/home/someone/props");
  EXPECT_EQ(config.out, "/elsewhere/out");
  EXPECT_EQ(config.seed, 7u);
  EXPECT_EQ(config.sizes.heads, 2u);
  EXPECT_EQ(config.sizes.gaussians, usual.sizes.gaussians);
  ASSERT_EQ(config.parts.size(), 1u);
  EXPECT_EQ(config.parts[0].stage, AutoencoderStage::kJoint);
  EXPECT_EQ(config.parts[0].batch, 3u);
  EXPECT_EQ(config.parts[0].weights.ssim, 0.4);
  // What a part does not say is that of its stage.
  EXPECT_EQ(config.parts[0].optimiser.learning_rate, usual.parts[2].optimiser.learning_rate);
  EXPECT_EQ(parsed(R"({"collection": "a", "out": "b"})").parts.size(), 3u);
}

TEST(TrainingConfig, SaysWhichSettingOfACheckpointDiffers) {
  const TrainingConfig config = parsed(R"({"collection": "a", "out": "b"})");
  TrainingConfig other = config;
  EXPECT_EQ(firstDifference(settingsJson(config), settingsJson(other)), "");
  other.out.clear();  // Weights do not depend on it.
  other.checkpoint_interval = 9;
  EXPECT_EQ(firstDifference(settingsJson(config), settingsJson(other)), "");
  other.parts[1].batch = 17;
  EXPECT_EQ(firstDifference(settingsJson(config), settingsJson(other)),
            "'parts.1.batch' is 2, the checkpoint has 17");
  other = config;
  other.parts.pop_back();
  EXPECT_EQ(firstDifference(settingsJson(config), settingsJson(other)),
            "the checkpoint has no 'parts.2.stage'");
  other = config;
  other.parts[0].stage = AutoencoderStage::kJoint;
  EXPECT_EQ(firstDifference(settingsJson(config), settingsJson(other)),
            "'parts.0.stage' is structure, the checkpoint has joint");
}

TEST(TrainingConfig, RefusesListsThatAreNone) {
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "parts": {"stage": "joint"}})"), Error);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "parts": [1]})"), Error);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "seed": [1]})"), Error);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "seed": null})"), Error);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "seed": -1})"), Error);
}

}  // namespace
}  // namespace stipple
