#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "fit_views.h"

namespace stipple::test {
namespace {

TEST_F(FitTest, PresetsOfSplatsChooseAStrategyThatDefaultsDoNot) {
  EXPECT_EQ(options_.strategy_utf8, nullptr);
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_EXPLICIT, STIPPLE_FIT_FAST));
  EXPECT_STREQ(options_.strategy_utf8, "adaptive");
  for (const uint32_t quality : {STIPPLE_FIT_BALANCED, STIPPLE_FIT_FINE_DETAIL}) {
    STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_EXPLICIT, quality));
    EXPECT_STREQ(options_.strategy_utf8, "improved");
  }
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_BALANCED));
  EXPECT_EQ(options_.strategy_utf8, nullptr);
}

TEST_F(FitTest, RefusesOptionsOutOfRange) {
  const auto refused = [&](const char* text) {
    StippleJob* job = nullptr;
    expectRefused(stipple_fit_start(context_, views_, &options_, &job),
                  STIPPLE_ERROR_INVALID_ARGUMENT, text);
    EXPECT_EQ(job, nullptr);
    stipple_fit_options_init(&options_);
  };
  options_.iterations = 0;
  refused("options->iterations is 0; 1 to 10000000 is allowed");
  options_.model = 5;
  refused("options->model is 5");
  options_.model = STIPPLE_FIT_MOTION;
  refused("all views have the same time");
  options_.model = STIPPLE_FIT_RELAY;
  refused("all views have the same time");
  options_.model = STIPPLE_FIT_SCAFFOLD;
  options_.strategy_utf8 = "adaptive";
  refused("anchors with features have none");
  options_.max_splats = 0;
  refused("options->max_splats is 0");
  options_.sh_degree = 5;
  refused("options->sh_degree is 5");
  options_.ssim_share = std::nan("");
  refused("options->ssim_share is");
  options_.background = 3;
  refused("options->background is 3");
  options_.checkpoint_seconds = -1;
  refused("options->checkpoint_seconds is -1");
  options_.resume = 1;
  refused("no checkpoint_path is given");
  options_.model = STIPPLE_FIT_FIELD;
  options_.min_anchors = options_.max_anchors + 1;
  refused("options->min_anchors is");
  options_.model = STIPPLE_FIT_FIELD;
  options_.gaussians_per_anchor = 3;
  refused("options->gaussians_per_anchor is 3; 4 to 32 is allowed");
  options_.model = STIPPLE_FIT_FIELD;
  options_.shell = 3;
  refused("options->shell is 3; auto (0), on (1) or off (2) is allowed");
  expectRefused(stipple_fit_options_preset(&options_, 0, 3), STIPPLE_ERROR_INVALID_ARGUMENT,
                "quality is 3");
}

TEST_F(FitTest, SetsOptionsByTheirNames) {
  const auto set = [&](const char* name, const char* value) {
    return stipple_fit_options_set(&options_, name, value);
  };
  STIPPLE_EXPECT_OK(set("iterations", "77"));
  STIPPLE_EXPECT_OK(set("--max-splats", "88"));
  STIPPLE_EXPECT_OK(set("background", "white"));
  STIPPLE_EXPECT_OK(set("image_bytes", "1.5MiB"));
  STIPPLE_EXPECT_OK(set("ssim_share", "0.25"));
  const std::string strategy = "mcmc";
  STIPPLE_EXPECT_OK(set("strategy", strategy.c_str()));
  EXPECT_EQ(options_.iterations, 77u);
  EXPECT_EQ(options_.max_splats, 88u);
  EXPECT_EQ(options_.background, uint32_t{STIPPLE_FIT_BACKGROUND_WHITE});
  EXPECT_EQ(options_.image_bytes, 3u << 19);
  EXPECT_EQ(options_.ssim_share, 0.25);
  EXPECT_EQ(options_.strategy_utf8, strategy.c_str());
  STIPPLE_EXPECT_OK(set("strategy", ""));
  EXPECT_EQ(options_.strategy_utf8, nullptr);
  expectRefused(set("--sh-degree", "5"), STIPPLE_ERROR_INVALID_ARGUMENT,
                "--sh-degree is 5; 0 to 4 is allowed");
  expectRefused(set("iteration", "5"), STIPPLE_ERROR_INVALID_ARGUMENT,
                "'iteration' is no option of a fit");
  EXPECT_EQ(options_.sh_degree, 0u);
}

TEST_F(FitTest, TellsEveryOption) {
  uint64_t count = 0;
  STIPPLE_ASSERT_OK(stipple_fit_option_count(&count));
  auto info = sized<StippleFitOptionInfo>();
  STIPPLE_ASSERT_OK(stipple_fit_option_info(0, &info));
  EXPECT_STREQ(info.name_utf8, "model");
  EXPECT_STREQ(info.choices_utf8, "explicit,field,motion,scaffold,relay");
  for (uint64_t i = 0; i < count; ++i) {
    STIPPLE_ASSERT_OK(stipple_fit_option_info(i, &info));
    if (std::string(info.name_utf8) != "iterations") continue;
    EXPECT_STREQ(info.presets_utf8[3 * STIPPLE_FIT_FIELD + STIPPLE_FIT_BALANCED], "2000");
    EXPECT_STREQ(info.motion_presets_utf8[STIPPLE_FIT_BALANCED], "4000");
    EXPECT_STREQ(info.scaffold_presets_utf8[STIPPLE_FIT_BALANCED], "4000");
    EXPECT_STREQ(info.relay_presets_utf8[STIPPLE_FIT_BALANCED], "15000");
  }
  STIPPLE_ASSERT_OK(stipple_fit_option_info(0, &info));
  EXPECT_EQ(info.kind, uint32_t{STIPPLE_FIT_OPTION_CHOICE});
  expectRefused(stipple_fit_option_info(count, &info), STIPPLE_ERROR_INVALID_ARGUMENT, "index is");
}

}  // namespace
}  // namespace stipple::test
