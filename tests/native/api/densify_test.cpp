#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fit_views.h"

namespace stipple::test {
namespace {

class DensifyTest : public FitViewsTest {
 protected:
  void SetUp() override {
    FitViewsTest::SetUp();
    stipple_densify_options_init(&options_);
    cloud_ = blob();
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    FitViewsTest::TearDown();
  }

  /// One grey splat in place of the three that the pictures show.
  StippleCloud* blob(uint32_t colour_space = STIPPLE_COLOUR_DISPLAY) {
    const float position[3] = {0, 0, 0.1f}, rotation[4] = {1, 0, 0, 0};
    const float scale[3] = {0.3f, 0.2f, 0.2f}, opacity = 0.9f, sh[3] = {0, 0, 0};
    auto arrays = sized<StippleCloudArrays>();
    arrays.colour_space = colour_space;
    arrays.count = 1;
    arrays.positions = position;
    arrays.rotations = rotation;
    arrays.scales = scale;
    arrays.opacities = &opacity;
    arrays.sh = sh;
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_cloud_create(context_, &arrays, &cloud));
    return cloud;
  }

  std::vector<float> densified(StippleContext* context) {
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_densify_start(context, cloud_, views_, &options_, &job));
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    StippleCloud* made = nullptr;
    STIPPLE_EXPECT_OK(stipple_job_cloud(job, &made));
    stipple_job_free(job);
    return taken(made);
  }

  void refused(StippleStatus status, const char* text) {
    StippleJob* job = nullptr;
    expectRefused(stipple_densify_start(context_, cloud_, views_, &options_, &job), status, text);
    EXPECT_EQ(job, nullptr);
    stipple_densify_options_init(&options_);
  }

  StippleDensifyOptions options_;
  StippleCloud* cloud_ = nullptr;
};

constexpr size_t kNumbers = 14;  // of a splat

TEST_F(DensifyTest, SplitsWhatThePicturesPullAt) {
  options_.max_splats = 10;
  options_.event_count = 3;
  const std::vector<float> once = densified(context_);
  EXPECT_GT(once.size(), 2 * kNumbers);
  EXPECT_LE(once.size(), 10 * kNumbers);
  for (const float value : once) EXPECT_TRUE(std::isfinite(value));
}

TEST_F(DensifyTest, TellsWhichSplatsAreNewAndWhatTheyContribute) {
  options_.max_splats = 10;
  options_.event_count = 3;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_densify_start(context_, cloud_, views_, &options_, &job));
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  StippleCloud* made = nullptr;
  STIPPLE_ASSERT_OK(stipple_job_cloud(job, &made));
  stipple_job_free(job);
  auto info = sized<StippleCloudInfo>();
  STIPPLE_ASSERT_OK(stipple_cloud_info(made, &info));
  std::vector<float> values(info.count);
  uint64_t count = 0;
  for (const StippleSplatQuantity quantity :
       {STIPPLE_QUANTITY_AGE, STIPPLE_QUANTITY_SCORE, STIPPLE_QUANTITY_CONTRIBUTION}) {
    STIPPLE_ASSERT_OK(stipple_cloud_quantity(made, quantity, values.size(), values.data(), &count));
    ASSERT_EQ(count, info.count);
    if (quantity != STIPPLE_QUANTITY_AGE) continue;
    // New splats come last.
    EXPECT_EQ(values.back(), 0);
    EXPECT_LE(*std::max_element(values.begin(), values.end()), 3);
    EXPECT_TRUE(std::is_sorted(values.rbegin(), values.rend()));
  }
  EXPECT_GT(*std::max_element(values.begin(), values.end()), 1);
  stipple_cloud_free(made);
  // A cloud from elsewhere tells its axes alone.
  STIPPLE_ASSERT_OK(stipple_cloud_quantity(cloud_, STIPPLE_QUANTITY_AGE, 0, nullptr, &count));
  EXPECT_EQ(count, 0u);
  float axis[3];
  STIPPLE_ASSERT_OK(stipple_cloud_quantity(cloud_, STIPPLE_QUANTITY_SPLIT_AXIS, 3, axis, &count));
  EXPECT_EQ(count, 3u);
  EXPECT_NEAR(axis[0], 1 - 0.2 / 0.3, 1e-6);  // stored scales have 24 bits
}

TEST_F(DensifyTest, GivesTheSameBitsForAnyThreads) {
  options_.max_splats = 10;
  options_.event_count = 3;
  StippleContext* one = withThreadCount(1);
  StippleContext* two = withThreadCount(2);
  EXPECT_EQ(densified(one), densified(two));
  stipple_context_free(one);
  stipple_context_free(two);
}

TEST_F(DensifyTest, RefusesWithOneMessage) {
  options_.event_count = 0;
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "options->event_count is 0; 1 to 1000 is allowed");
  options_.max_splats = (uint64_t{1} << 28) + 1;
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "options->max_splats is 268435457");
  options_.strategy_utf8 = "best";
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "strategy is 'best'; there is adaptive");
  StippleCloud* const display = cloud_;
  cloud_ = blob(STIPPLE_COLOUR_LINEAR);
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "different colour spaces");
  stipple_cloud_free(cloud_);
  auto arrays = sized<StippleCloudArrays>();
  STIPPLE_ASSERT_OK(stipple_cloud_create(context_, &arrays, &cloud_));
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "the cloud has no splats");
  stipple_cloud_free(cloud_);
  cloud_ = nullptr;
  refused(STIPPLE_ERROR_INVALID_ARGUMENT, "cloud is NULL");
  cloud_ = display;
}

TEST_F(DensifyTest, RefusesMoreMemoryThanTheContextHas) {
  StippleContextOptions few;
  stipple_context_options_init(&few);
  few.memory_limit_bytes = 1000;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&few, &context));
  StippleJob* job = nullptr;
  expectRefused(stipple_densify_start(context, cloud_, views_, &options_, &job),
                STIPPLE_ERROR_MEMORY_LIMIT, "densifying this cloud");
  stipple_context_free(context);
}

TEST_F(DensifyTest, RefusesPicturesThatShowNothing) {
  StippleViews* black = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &black));
  addViews(black, 0);
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_densify_start(context_, cloud_, black, nullptr, &job));
  expectRefused(stipple_job_wait(job), STIPPLE_ERROR_INVALID_ARGUMENT, "black everywhere");
  stipple_job_free(job);
  stipple_views_free(black);
}

}  // namespace
}  // namespace stipple::test
