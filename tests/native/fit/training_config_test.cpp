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

TEST(TrainingConfig, SplatsFollowTheSpacingButWhereSettingsOfBeforeSayNothing) {
  const TrainingConfig usual = parsed(R"({"collection": "a", "out": "b"})");
  EXPECT_TRUE(usual.sizes.follows_spacing);
  EXPECT_TRUE(readSettings(settingsJson(usual), "ours").sizes.follows_spacing);
  const TrainingConfig published =
      parsed(R"({"collection": "a", "out": "b", "network": {"follows_spacing": 0}})");
  EXPECT_FALSE(published.sizes.follows_spacing);
  EXPECT_EQ(settingsJson(published).find("follows_spacing"), std::string::npos);
  EXPECT_FALSE(readSettings(settingsJson(published), "ours").sizes.follows_spacing);
}

TEST(TrainingConfig, NetworksThatAreLearnedFurtherFollowTheSpacingWhereThatIsSaid) {
  const std::string of_before = R"({"network.heads": 2})";
  const auto started = [&](const std::string& more) {
    TrainingConfig config =
        parsed((R"({"collection": "a", "out": "b", "start": "c")" + more + "}").c_str());
    takeStart(of_before, config);
    return config.sizes;
  };
  const std::string parts = R"(, "parts": [{"stage": "joint"}])";
  EXPECT_FALSE(started(parts).follows_spacing);
  const AutoencoderSizes sizes = started(parts + R"(, "network": {"follows_spacing": 1})");
  EXPECT_TRUE(sizes.follows_spacing);
  EXPECT_EQ(sizes.heads, 2u);
  EXPECT_THROW(started(parts + R"(, "network": {"heads": 2})"), Error);
  // The flow alone would leave splats that nothing has made fit.
  const std::string flow = R"(, "flow": {"steps": 900})";
  EXPECT_FALSE(started(flow).follows_spacing);
  EXPECT_THROW(started(flow + R"(, "network": {"follows_spacing": 1})"), Error);
}

TEST(TrainingConfig, ScalesLossesWhereThatIsSaid) {
  const TrainingConfig usual = parsed(R"({"collection": "a", "out": "b"})");
  EXPECT_EQ(usual.parts[0].optimiser.loss_scaling, LossScaling::kNone);
  // What it does not depend on is not written: checkpoints of earlier versions go on.
  EXPECT_EQ(settingsJson(usual).find("loss_scale"), std::string::npos);
  const TrainingConfig config =
      parsed(R"({"collection": "a", "out": "b", "flow": {"steps": 900, "loss_scale": "dynamic"},
                 "parts": [{"loss_scale": "dynamic", "loss_scale_start": 16}, {}]})");
  EXPECT_EQ(config.parts[0].optimiser.loss_scaling, LossScaling::kDynamic);
  EXPECT_EQ(config.parts[0].optimiser.loss_scale_start, 16);
  EXPECT_EQ(config.parts[0].optimiser.loss_scale_growth, 0.001);
  EXPECT_EQ(config.parts[1].optimiser.loss_scaling, LossScaling::kNone);
  EXPECT_EQ(config.flow.schedule.optimiser.loss_scaling, LossScaling::kDynamic);
  const TrainingConfig read = readSettings(settingsJson(config), "settings");
  EXPECT_EQ(settingsJson(read), settingsJson(config));
  EXPECT_EQ(read.parts[0].optimiser.loss_scale_start, 16);
  EXPECT_NE(firstDifference(settingsJson(config), settingsJson(usual)), "");
  try {
    parsed(R"({"collection": "a", "out": "b", "parts": [{"loss_scale": "static"}]})");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "config.json: 'parts.0.loss_scale' is 'static'; none or dynamic is allowed");
  }
}

TEST(TrainingConfig, ScalesLossesWhereProductsAreInBfloat16) {
  const TrainingConfig config =
      parsed(R"({"collection": "a", "out": "b", "precision": "bfloat16", "flow": {"steps": 900},
                 "parts": [{"stage": "joint"}, {"loss_scale": "none"}]})");
  EXPECT_EQ(config.precision, FactorPrecision::kBfloat16);
  EXPECT_EQ(config.parts[0].optimiser.loss_scaling, LossScaling::kDynamic);
  EXPECT_EQ(config.parts[1].optimiser.loss_scaling, LossScaling::kNone) << "as it says";
  EXPECT_EQ(config.flow.schedule.optimiser.loss_scaling, LossScaling::kDynamic);
  const TrainingConfig read = readSettings(settingsJson(config), "settings");
  EXPECT_EQ(read.precision, FactorPrecision::kBfloat16);
  EXPECT_EQ(settingsJson(read), settingsJson(config));
  const TrainingConfig usual = parsed(R"({"collection": "a", "out": "b"})");
  EXPECT_EQ(usual.precision, FactorPrecision::kFloat32);
  EXPECT_EQ(settingsJson(usual).find("precision"), std::string::npos);
  const TrainingConfig detail = parsed(
      R"({"collection": "a", "out": "b", "detail": {"steps": 500}, "precision": "bfloat16"})");
  EXPECT_EQ(detail.detail.schedule.optimiser.loss_scaling, LossScaling::kDynamic);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "precision": "float16"})"), Error);
  EXPECT_THROW(parsed(R"({"collection": "a", "out": "b", "precision": 16})"), Error);
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
