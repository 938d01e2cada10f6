#include "shot/accuracy_settings.h"

#include <gtest/gtest.h>

#include <functional>

#include "base/error.h"
#include "shot/shot_settings.h"

namespace stipple {
namespace {

constexpr AccuracyLevel kLevels[] = {AccuracyLevel::kDraft, AccuracyLevel::kPreview,
                                     AccuracyLevel::kFinal, AccuracyLevel::kReference};

TEST(AccuracySettings, EveryLevelIsValidAndNamedByItselfAlone) {
  for (const AccuracyLevel level : kLevels) {
    EXPECT_NO_THROW(validate(accuracyOf(level), "accuracy"));
    EXPECT_EQ(accuracyName(accuracyOf(level)), accuracyLevelName(level));
  }
  EXPECT_LT(accuracyOf(AccuracyLevel::kDraft).budget_share,
            accuracyOf(AccuracyLevel::kPreview).budget_share);
  EXPECT_EQ(renderAccuracy(accuracyOf(AccuracyLevel::kReference)).limits.least_alpha,
            unlimitedRays().limits.least_alpha);
}

TEST(AccuracySettings, ANameTellsTheKnobsThatDifferFromTheLevel) {
  AccuracySettings accuracy;
  accuracy.projection = RayProjection::kRay;
  accuracy.least_alpha = 0.02;
  EXPECT_EQ(accuracyName(accuracy), "final + projection ray + cut-off 0.02");
  accuracy = accuracyOf(AccuracyLevel::kDraft);
  accuracy.antialiasing = Antialiasing::kSamples;
  accuracy.samples_per_side = 3;
  EXPECT_EQ(accuracyName(accuracy), "draft + samples 3");
}

TEST(AccuracySettings, KnobsOutsideTheirRangeAreRefusedByName) {
  const auto refused = [](const std::function<void(AccuracySettings&)>& change, const char* what) {
    AccuracySettings accuracy;
    change(accuracy);
    try {
      validate(accuracy, "given");
      ADD_FAILURE() << what;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  refused([](AccuracySettings& a) { a.samples_per_side = 0; }, "given->samples_per_side is 0");
  refused([](AccuracySettings& a) { a.samples_per_side = 2; }, "without antialiasing by samples");
  refused([](AccuracySettings& a) { a.least_alpha = 1; }, "given->min_alpha is 1");
  refused([](AccuracySettings& a) { a.budget_share = 0; }, "given->budget_share is 0");
  refused([](AccuracySettings& a) { a.level = AccuracyLevel::kReference; }, "with a knob below it");
}

TEST(ShotSettings, AnAccuracyTakesTheSmallerDegreeAndItsOwnLowPass) {
  ShotSettings settings;
  settings.options.sh_degree_limit = 1;
  AccuracySettings accuracy;
  accuracy.sh_degree_limit = 3;
  accuracy.antialiasing = Antialiasing::kMip;
  takeAccuracy(accuracy, settings);
  EXPECT_EQ(settings.options.sh_degree_limit, 1);
  EXPECT_EQ(settings.options.low_pass, LowPass::kMip);
  settings.options.low_pass = LowPass::kClassic;
  EXPECT_THROW(takeAccuracy(accuracy, settings), Error);
  settings.method = ShotMethod::kRays;
  EXPECT_THROW(takeAccuracy(accuracyOf(AccuracyLevel::kFinal), settings), Error);
}

TEST(AccuracySettings, EveryKnobSaysWhatIsKnownOfItsError) {
  for (const AccuracyKnob& knob : accuracyKnobs()) {
    EXPECT_EQ(std::string(knob.bound).starts_with("No bound"), !knob.has_bound) << knob.name;
  }
  EXPECT_STREQ(accuracyVerdict(46), "looks identical");
  EXPECT_STREQ(accuracyVerdict(29.9), "obvious");
}

}  // namespace
}  // namespace stipple
