#include <gmock/gmock.h>

#include <cmath>
#include <cstddef>
#include <cstring>

#include "api/fixtures.h"

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

class Grade : public ApiTest {
 protected:
  static StippleGrade gradeOf(double exposure, double saturation, double opacity) {
    StippleGradeSettings settings;
    stipple_grade_settings_init(&settings);
    settings.exposure = exposure;
    settings.saturation = saturation;
    settings.opacity = opacity;
    StippleGrade grade;
    stipple_grade_init(&grade);
    STIPPLE_EXPECT_OK(stipple_grade_from_settings(&settings, STIPPLE_COLOUR_DISPLAY, &grade));
    return grade;
  }

  std::vector<float> draw(const StippleInstance* instances, uint64_t count) {
    const StippleCamera camera = frontCamera();
    StippleRenderOptions options;
    stipple_render_options_init(&options);
    std::vector<float> colour(size_t{camera.width} * camera.height * 4, -1.0f);
    auto buffers = sized<StippleRenderBuffers>();
    buffers.colour = colour.data();
    StippleRenderer* renderer = nullptr;
    STIPPLE_EXPECT_OK(stipple_renderer_create(context_, &renderer));
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_renderer_render_start(renderer, instances, count, &camera, &options,
                                                    &buffers, &job));
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    stipple_job_free(job);
    stipple_renderer_free(renderer);
    return colour;
  }
};

TEST_F(Grade, OfAnInstanceLooksLikeTheBakedCloud) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  const StippleGrade grade = gradeOf(1.0, 0.5, 0.5);
  StippleInstance instance = placed(cloud);
  instance.grade = &grade;
  const std::vector<float> seen = draw(&instance, 1);
  StippleCloud* baked = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_grade(cloud, &grade, &baked));
  const StippleInstance plain = placed(baked);
  const std::vector<float> expected = draw(&plain, 1);
  for (size_t i = 0; i < seen.size(); ++i) EXPECT_NEAR(seen[i], expected[i], 1e-6f);
  instance.grade = nullptr;
  EXPECT_NE(seen, draw(&instance, 1));
  stipple_cloud_free(baked);
  stipple_cloud_free(cloud);
}

TEST_F(Grade, DefaultsChangeNothing) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  StippleGrade neutral;
  stipple_grade_init(&neutral);
  const StippleGrade from_settings = gradeOf(0, 1, 1);
  EXPECT_EQ(std::memcmp(&neutral, &from_settings, sizeof(neutral)), 0);
  StippleInstance instance = placed(cloud);
  const std::vector<float> expected = draw(&instance, 1);
  instance.grade = &neutral;
  EXPECT_EQ(draw(&instance, 1), expected);
  stipple_cloud_free(cloud);
}

TEST_F(Grade, IsNotReadFromCallersThatDoNotKnowIt) {
  // An older caller's instances end before the grade and lie closer together.
  struct Older {
    uint32_t struct_size;
    uint32_t reserved;
    const StippleCloud* cloud;
    double matrix[16];
  };
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f, 0.5f);
  Older older[2] = {};
  StippleInstance newer[2];
  for (int i = 0; i < 2; ++i) {
    newer[i] = placed(cloud);
    newer[i].matrix[3] = 0.4 * i;
    std::memcpy(&older[i], &newer[i], sizeof(Older));
    older[i].struct_size = sizeof(Older);
  }
  EXPECT_EQ(draw(reinterpret_cast<const StippleInstance*>(older), 2), draw(newer, 2));
  stipple_cloud_free(cloud);
}

TEST_F(Grade, IsRefusedOutsideItsRange) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  StippleGradeSettings settings;
  stipple_grade_settings_init(&settings);
  settings.exposure = 40;
  StippleGrade grade;
  stipple_grade_init(&grade);
  EXPECT_EQ(stipple_grade_from_settings(&settings, STIPPLE_COLOUR_DISPLAY, &grade),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(), "exposure is 40; -16 to 16 is allowed");
  EXPECT_EQ(stipple_grade_from_settings(&settings, 2, &grade), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("colour_space is 2"));

  grade.opacity = -1;
  StippleCloud* baked = nullptr;
  EXPECT_EQ(stipple_cloud_grade(cloud, &grade, &baked), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(baked, nullptr);
  StippleInstance instance = placed(cloud);
  instance.grade = &grade;
  StippleCloud* merged = nullptr;
  EXPECT_EQ(stipple_cloud_merge(&instance, 1, STIPPLE_FRAME_UNKNOWN, &merged),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(),
               "instances[0].grade: opacity is -1; 0 to 1 is allowed");
  grade.struct_size = 4;
  EXPECT_EQ(stipple_cloud_merge(&instance, 1, STIPPLE_FRAME_UNKNOWN, &merged),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("instances[0].grade->struct_size is 4"));
  stipple_cloud_free(cloud);
}

TEST_F(Grade, OfInstancesThatEndBeforeTheirTimeIsRead) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  StippleInstance instance = placed(cloud);
  StippleGrade grade;
  stipple_grade_init(&grade);
  grade.opacity = -1;
  instance.grade = &grade;
  instance.struct_size = offsetof(StippleInstance, time);
  StippleCloud* merged = nullptr;
  EXPECT_EQ(stipple_cloud_merge(&instance, 1, STIPPLE_FRAME_UNKNOWN, &merged),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("instances[0].grade"));
  stipple_cloud_free(cloud);
}

TEST_F(Grade, TimeOfInstancesIsFiniteAndChangesNoCloud) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  StippleInstance instance = placed(cloud);
  StippleCloud* merged = nullptr;
  for (const double time : {std::nan(""), HUGE_VAL}) {
    instance.time = time;
    EXPECT_EQ(stipple_cloud_merge(&instance, 1, STIPPLE_FRAME_UNKNOWN, &merged),
              STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr("instances[0].time"));
  }
  instance.time = -2.5;
  STIPPLE_EXPECT_OK(stipple_cloud_merge(&instance, 1, STIPPLE_FRAME_UNKNOWN, &merged));
  stipple_cloud_free(merged);
  stipple_cloud_free(cloud);
}

TEST_F(Grade, OfInstancesOfMixedSizesIsRefused) {
  StippleCloud* cloud = oneSplat(0.25f, 0.5f, 0.75f);
  StippleInstance instances[2] = {placed(cloud), placed(cloud)};
  instances[1].struct_size = sizeof(StippleInstance) - 8;
  StippleCloud* merged = nullptr;
  EXPECT_EQ(stipple_cloud_merge(instances, 2, STIPPLE_FRAME_UNKNOWN, &merged),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("instances[1]->struct_size"));
  instances[0].struct_size = 5;
  EXPECT_EQ(stipple_cloud_merge(instances, 2, STIPPLE_FRAME_UNKNOWN, &merged),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("instances[0]->struct_size is 5"));
  stipple_cloud_free(cloud);
}

}  // namespace
}  // namespace stipple::test
