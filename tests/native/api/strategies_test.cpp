#include <gtest/gtest.h>

#include <set>
#include <string>

#include "fit_views.h"

namespace stipple::test {
namespace {

class StrategiesTest : public FitViewsTest {
 protected:
  void SetUp() override {
    FitViewsTest::SetUp();
    stipple_fit_options_init(&options_);
    options_.iterations = 20;
    options_.sh_degree = 0;
  }

  void refused(StippleStatus status, const char* text) {
    StippleJob* job = nullptr;
    expectRefused(stipple_fit_start(context_, views_, &options_, &job), status, text);
    EXPECT_EQ(job, nullptr);
  }

  uint64_t bound() {
    uint64_t bytes = 0;
    STIPPLE_EXPECT_OK(stipple_fit_memory_bound(views_, &options_, &bytes));
    return bytes;
  }

  StippleFitOptions options_;
};

TEST_F(StrategiesTest, AreListedWithSentencesAndCanBeMade) {
  uint64_t count = 0, part_count = 0;
  STIPPLE_ASSERT_OK(stipple_strategy_count(&count));
  STIPPLE_ASSERT_OK(stipple_strategy_part_count(&part_count));
  std::set<std::string> names;
  for (uint64_t i = 0; i < count + part_count; ++i) {
    auto info = sized<StippleStrategyInfo>();
    STIPPLE_ASSERT_OK(i < count ? stipple_strategy_info(i, &info)
                                : stipple_strategy_part_info(i - count, &info));
    EXPECT_TRUE(names.insert(info.name_utf8).second) << info.name_utf8;
    EXPECT_GT(std::string(info.summary_utf8).size(), 20u);
    EXPECT_GT(std::string(info.label_utf8).size(), 2u);
    EXPECT_EQ(info.bit == STIPPLE_NO_INDEX, i < count) << info.name_utf8;
    const bool is_field = info.model == STIPPLE_FIT_FIELD;
    EXPECT_EQ(std::string(info.decides_utf8).empty(), is_field) << info.name_utf8;
    for (uint64_t k = 0; k < info.setting_count; ++k) {
      auto setting = sized<StippleStrategySetting>();
      STIPPLE_ASSERT_OK(stipple_strategy_setting(info.name_utf8, k, &setting));
      EXPECT_LE(setting.minimum, setting.default_value) << setting.name_utf8;
      EXPECT_LE(setting.default_value, setting.maximum) << setting.name_utf8;
      // What is told can be set.
      const std::string text = std::string(i < count ? "" : "adaptive+") + info.name_utf8 + "(" +
                               setting.name_utf8 + "=" + std::to_string(setting.maximum) + ")";
      STIPPLE_EXPECT_OK(stipple_strategy_check(text.c_str()));
    }
    EXPECT_EQ(is_field, std::string(info.name_utf8) == "learned_density");
    if (i < count && !is_field) {
      STIPPLE_EXPECT_OK(stipple_strategy_check(info.name_utf8));
    }
  }
  EXPECT_TRUE(names.contains("adaptive"));
  EXPECT_TRUE(names.contains("long_axis_split"));
  auto info = sized<StippleStrategyInfo>();
  expectRefused(stipple_strategy_info(count, &info), STIPPLE_ERROR_INVALID_ARGUMENT,
                ("index is " + std::to_string(count)).c_str());
  expectRefused(stipple_strategy_part_info(part_count, &info), STIPPLE_ERROR_INVALID_ARGUMENT,
                "index is");
  auto setting = sized<StippleStrategySetting>();
  expectRefused(stipple_strategy_setting("nothing", 0, &setting), STIPPLE_ERROR_INVALID_ARGUMENT,
                "which is no strategy and no part");
  expectRefused(stipple_strategy_setting("adaptive", 9, &setting), STIPPLE_ERROR_INVALID_ARGUMENT,
                "index is 9");
  expectRefused(stipple_strategy_setting("opacity_correction", 0, &setting),
                STIPPLE_ERROR_INVALID_ARGUMENT, "has no settings");
  expectRefused(stipple_strategy_check("adaptive+nothing"), STIPPLE_ERROR_INVALID_ARGUMENT,
                "part is 'nothing'");
}

TEST_F(StrategiesTest, BelongToTheirModel) {
  options_.strategy_utf8 = "learned_density";
  refused(STIPPLE_ERROR_INVALID_ARGUMENT,
          "learned_density moves the density of a field, which explicit splats do not have");
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.strategy_utf8 = "adaptive";
  refused(STIPPLE_ERROR_INVALID_ARGUMENT,
          "strategy is 'adaptive', which is not one of fields; there is learned_density");
}

TEST_F(StrategiesTest, LearnedDensityIsTheDensityGradientOfAField) {
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.iterations = 30;
  options_.min_anchors = 16;
  options_.max_anchors = 64;
  options_.gaussians_per_anchor = 4;
  std::vector<float> results[3];
  for (int k = 0; k < 3; ++k) {
    options_.strategy_utf8 = k == 1 ? "learned_density" : nullptr;
    options_.density_gradient = k == 0;
    StippleJob* job = nullptr;
    STIPPLE_ASSERT_OK(stipple_fit_start(context_, views_, &options_, &job));
    STIPPLE_ASSERT_OK(stipple_job_wait(job));
    StippleCloud* cloud = nullptr;
    STIPPLE_ASSERT_OK(stipple_fit_cloud(job, 0, &cloud));
    results[k] = taken(cloud);
    stipple_job_free(job);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_NE(results[0], results[2]);
}

TEST_F(StrategiesTest, AMemoryCapLowersTheCountUntilTheFitIsBelowIt) {
  options_.max_splats = 1000000;
  const uint64_t free_bound = bound();
  options_.max_bytes = free_bound / 10;
  const uint64_t held = bound();
  EXPECT_LE(held, free_bound / 10);
  EXPECT_GT(held, free_bound / 11);  // one splat less than a byte too many
  options_.max_bytes = 2 * free_bound;
  EXPECT_EQ(bound(), free_bound);

  // Few enough that the fit feels it: it begins with more, and half of the memory may be images.
  options_.max_splats = 25;
  const uint64_t limit = bound();
  options_.image_bytes = limit / 2;
  const uint64_t with_25 = bound();
  options_.max_splats = 26;
  const uint64_t most = 25 + (limit - with_25) / (bound() - with_25);
  options_.max_splats = 1000;
  options_.max_bytes = limit;
  options_.strategy_utf8 = "adaptive(threshold=1e-9)";
  options_.iterations = 1200;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_fit_start(context_, views_, &options_, &job));
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  auto figures = sized<StippleFitFigures>();
  STIPPLE_ASSERT_OK(stipple_fit_figures(job, &figures));
  EXPECT_LT(most, 100u);
  EXPECT_GE(figures.splat_count, most * 3 / 4);
  EXPECT_LE(figures.splat_count, most);
  stipple_job_free(job);
}

TEST_F(StrategiesTest, AMemoryCapBelowOneSplatOrTheFieldIsRefused) {
  options_.max_bytes = 100;
  refused(STIPPLE_ERROR_MEMORY_LIMIT, "options->max_bytes is 100; one splat and the images");
  STIPPLE_ASSERT_OK(stipple_fit_options_preset(&options_, STIPPLE_FIT_FIELD, STIPPLE_FIT_FAST));
  options_.max_bytes = 1000000;
  refused(STIPPLE_ERROR_MEMORY_LIMIT, "options->max_bytes is 1000000; 8192 anchors");
}

}  // namespace
}  // namespace stipple::test
