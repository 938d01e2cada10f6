#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include "api/fixtures.h"

// Levels and knobs at the boundary: what a caller can get wrong, older and newer structs, and the
// life of jobs and reports.

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

class Accuracy : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    cloud_ = oneSplat(0.25f, 0.5f, 0.75f);
    STIPPLE_ASSERT_OK(stipple_accuracy_init(STIPPLE_ACCURACY_FINAL, &accuracy_));
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    ApiTest::TearDown();
  }

  StippleStatus startMeasuring(const StippleAccuracyMeasureOptions* options, StippleJob** job,
                               uint64_t count = 1) {
    const StippleInstance instance = placed(cloud_);
    const StippleCamera camera = frontCamera();
    return stipple_accuracy_measure_start(context_, &instance, count, &camera, nullptr, options,
                                          job);
  }

  StippleAccuracyReport* measured() {
    StippleAccuracyMeasureOptions options;
    stipple_accuracy_measure_options_init(&options);
    options.repetitions = 1;
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(startMeasuring(&options, &job));
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    StippleAccuracyReport* report = nullptr;
    STIPPLE_EXPECT_OK(stipple_job_accuracy_report(job, &report));
    stipple_job_free(job);  // the report holds its own share
    return report;
  }

  StippleCloud* cloud_ = nullptr;
  StippleAccuracy accuracy_ = {};
};

TEST_F(Accuracy, EveryKnobOutsideItsRangeIsRefusedByName) {
  const std::pair<std::function<void(StippleAccuracy&)>, const char*> cases[] = {
      {[](StippleAccuracy& a) { a.level = 4; }, "accuracy->level is 4; 0 to 3 is allowed"},
      {[](StippleAccuracy& a) { a.order = 2; }, "accuracy->order is 2; 0 to 1 is allowed"},
      {[](StippleAccuracy& a) { a.projection = 2; }, "accuracy->projection is 2; 0 to 1"},
      {[](StippleAccuracy& a) { a.antialiasing = 3; }, "accuracy->antialiasing is 3; 0 to 2"},
      {[](StippleAccuracy& a) { a.precision = 2; }, "accuracy->precision is 2; 0 to 1"},
      {[](StippleAccuracy& a) { a.sh_degree_limit = 5; }, "accuracy->sh_degree_limit is 5; 0 to 4"},
      {[](StippleAccuracy& a) { a.samples_per_side = 0; },
       "accuracy->samples_per_side is 0; 1 to 16 is allowed"},
      {[](StippleAccuracy& a) { a.samples_per_side = 2; },
       "accuracy->samples_per_side is 2 without antialiasing by samples"},
      {[](StippleAccuracy& a) { a.min_alpha = 1; },
       "accuracy->min_alpha is 1; a number above 0"},
      {[](StippleAccuracy& a) { a.budget_share = std::nan(""); }, "accuracy->budget_share is nan"},
      {[](StippleAccuracy& a) { a.level = STIPPLE_ACCURACY_REFERENCE; },
       "accuracy->level is reference with a knob below it"},
  };
  for (const auto& [change, text] : cases) {
    StippleAccuracy bad = accuracy_;
    change(bad);
    EXPECT_EQ(stipple_accuracy_check(&bad), STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr(text));
  }
  STIPPLE_EXPECT_OK(stipple_accuracy_check(&accuracy_));
  StippleAccuracy untouched = accuracy_;
  EXPECT_EQ(stipple_accuracy_init(9, &untouched), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(std::memcmp(&untouched, &accuracy_, sizeof(untouched)), 0);
  EXPECT_EQ(stipple_accuracy_init(2, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
}

TEST_F(Accuracy, AnOlderStructHasTheOtherKnobsOfItsLevel) {
  StippleRenderOptions options;
  stipple_render_options_init(&options);
  options.output_colour = STIPPLE_OUTPUT_COMPOSITED;
  StippleAccuracy reference;
  STIPPLE_ASSERT_OK(stipple_accuracy_init(STIPPLE_ACCURACY_REFERENCE, &reference));
  options.accuracy = &reference;
  const auto whole = render(context_, cloud_, options, frontCamera());
  reference.struct_size = 2 * sizeof(uint32_t);  // level alone
  reference.samples_per_side = 99;
  EXPECT_EQ(render(context_, cloud_, options, frontCamera()), whole);
}

TEST_F(Accuracy, BackwardPassesRefuseIt) {
  StippleRenderOptions options;
  stipple_render_options_init(&options);
  options.accuracy = &accuracy_;
  StippleRenderer* renderer = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer));
  const StippleInstance instance = placed(cloud_);
  const StippleCamera camera = frontCamera();
  auto input = sized<StippleBackwardInput>();
  auto gradients = sized<StippleSplatGradients>();
  auto result = sized<StippleBackwardResult>();
  StippleJob* job = nullptr;
  EXPECT_EQ(stipple_renderer_backward_start(renderer, &instance, 1, &camera, &options, &input,
                                            &gradients, &result, &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("options->accuracy is set"));
  stipple_renderer_free(renderer);
}

TEST_F(Accuracy, MeasuringRefusesWhatItCannotMeasure) {
  StippleJob* job = nullptr;
  EXPECT_EQ(startMeasuring(nullptr, &job, 0), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(),
              HasSubstr("the instances have 0 splats; measuring needs at least 1"));
  StippleAccuracyMeasureOptions options;
  stipple_accuracy_measure_options_init(&options);
  options.repetitions = 0;
  EXPECT_EQ(startMeasuring(&options, &job), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("options->repetitions is 0; 1 to 1000"));
  stipple_accuracy_measure_options_init(&options);
  options.setting_count = 1;
  EXPECT_EQ(startMeasuring(&options, &job), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("options->settings is NULL"));
  EXPECT_EQ(job, nullptr);
}

TEST_F(Accuracy, AReportChoosesOrSaysTheLeastThatIsNeeded) {
  StippleAccuracyReport* report = measured();
  auto info = sized<StippleAccuracyReportInfo>();
  STIPPLE_EXPECT_OK(stipple_accuracy_report_info(report, &info));
  EXPECT_EQ(info.compared_pixels, uint64_t{64} * 48);
  uint64_t index = 99;
  STIPPLE_EXPECT_OK(stipple_accuracy_report_best_within(report, 1e9, &index));
  EXPECT_EQ(index, info.row_count - 1);  // the reference: nothing is better
  EXPECT_EQ(stipple_accuracy_report_best_within(report, 1e-12, &index),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("the fastest, "));
  EXPECT_THAT(stipple_last_error_message(), HasSubstr(", needs "));
  EXPECT_EQ(index, info.row_count - 1);
  auto row = sized<StippleAccuracyRow>();
  EXPECT_EQ(stipple_accuracy_report_row(report, info.row_count, &row),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  STIPPLE_EXPECT_OK(stipple_accuracy_report_row(report, 0, &row));
  EXPECT_STREQ(row.name_utf8, "draft");
  uint32_t width = 0, height = 0;
  float pixel = 0;
  EXPECT_EQ(stipple_accuracy_report_draw(report, 1.0, 1, &pixel, &width, &height),
            STIPPLE_ERROR_BUFFER_TOO_SMALL);
  EXPECT_EQ(width, 840u);
  stipple_accuracy_report_free(report);
  stipple_accuracy_report_free(nullptr);
}

TEST_F(Accuracy, AnotherJobHasNoReport) {
  StippleVoxelizeOptions options;
  stipple_voxelize_options_init(&options);
  options.resolution = 8;
  const StippleInstance instance = placed(cloud_);
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_voxelize_start(context_, &instance, 1, &options, &job));
  STIPPLE_EXPECT_OK(stipple_job_wait(job));
  StippleAccuracyReport* report = nullptr;
  EXPECT_EQ(stipple_job_accuracy_report(job, &report), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(),
              HasSubstr("this job does not make a report of accuracy"));
  stipple_job_free(job);
}

}  // namespace
}  // namespace stipple::test
