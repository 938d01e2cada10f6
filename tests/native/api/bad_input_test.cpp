#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "api/fixtures.h"

// What a caller can get wrong in drawing: refused at once, by a call that starts no job, with a
// message that names the thing, the value seen and the value allowed.

namespace stipple::test {
namespace {

using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class BadInput : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer_));
    cloud_ = oneSplat(0.25f, 0.5f, 0.75f);
    stipple_render_options_init(&options_);
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    stipple_renderer_free(renderer_);
    ApiTest::TearDown();
  }

  /// Draws and waits. Out: the status of the start, and no job where that failed.
  StippleStatus draw(StippleRenderer* renderer, const StippleInstance* instances, uint64_t count,
                     const StippleCamera& camera, StippleRenderBuffers buffers) {
    StippleJob* job = nullptr;
    const StippleStatus status = stipple_renderer_render_start(renderer, instances, count, &camera,
                                                               &options_, &buffers, &job);
    EXPECT_EQ(job == nullptr, status != STIPPLE_OK);
    if (job) {
      STIPPLE_EXPECT_OK(stipple_job_wait(job));
    }
    stipple_job_free(job);
    return status;
  }

  StippleStatus draw(const StippleInstance& instance, const StippleCamera& camera) {
    return draw(renderer_, &instance, 1, camera, sized<StippleRenderBuffers>());
  }

  void expectInvalid(StippleStatus status, const char* part) {
    EXPECT_EQ(status, STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_THAT(stipple_last_error_message(), HasSubstr(part));
  }

  StippleRenderer* renderer_ = nullptr;
  StippleCloud* cloud_ = nullptr;
  StippleRenderOptions options_ = {};
};

TEST_F(BadInput, CamerasThatMakeNoPictureAreRefused) {
  struct Case {
    std::function<void(StippleCamera&)> spoil;
    const char* message;
  };
  const Case cases[] = {
      {[](StippleCamera& c) { c.width = c.height = 0; }, "camera is 0 x 0 pixels; each side must"},
      {[](StippleCamera& c) { c.height = 65537; }, "camera is 64 x 65537 pixels"},
      {[](StippleCamera& c) { c.fx = kNan; }, "focal length is nan"},
      {[](StippleCamera& c) { c.cy = kInfinity; }, "camera.cy is inf"},
      {[](StippleCamera& c) { c.world_to_camera[6] = kNan; }, "camera.world_to_camera is nan"},
      {[](StippleCamera& c) { c.near_plane = c.far_plane; }, "1e-9 <= near < far is needed"},
      {[](StippleCamera& c) { c.far_plane = kNan; }, "camera.far_plane is nan"},
      {[](StippleCamera& c) { c.model = 5; }, "camera->model is 5; 0 to 4 is allowed"}};
  const StippleInstance instance = placed(cloud_);
  for (const Case& c : cases) {
    StippleCamera camera = frontCamera();
    c.spoil(camera);
    expectInvalid(draw(instance, camera), c.message);
    uint64_t bytes = 7;
    expectInvalid(stipple_renderer_memory_bound(renderer_, &instance, 1, &camera, &bytes),
                  c.message);
    EXPECT_EQ(bytes, 7u);
  }
}

TEST_F(BadInput, PlacementsAndBackgroundsThatAreNotNumbersAreRefused) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    StippleInstance instance = placed(cloud_);
    instance.matrix[3] = bad;
    expectInvalid(draw(instance, frontCamera()), "instances[0].matrix is ");
    options_.background[1] = bad;
    expectInvalid(draw(placed(cloud_), frontCamera()), "options->background is ");
    options_.background[1] = 0;
  }
  StippleInstance instance = placed(cloud_);
  instance.matrix[0] = 0;
  STIPPLE_EXPECT_OK(draw(placed(cloud_), frontCamera()));
  StippleJob* job = nullptr;
  const StippleCamera camera = frontCamera();
  const auto buffers = sized<StippleRenderBuffers>();
  const StippleStatus started =
      stipple_renderer_render_start(renderer_, &instance, 1, &camera, &options_, &buffers, &job);
  expectInvalid(job ? stipple_job_wait(job) : started, "matrix");
  stipple_job_free(job);
}

TEST_F(BadInput, ColumnsAreHeldToTheSameRangesAndAllThere) {
  float position[3] = {0, 0, 0}, rotation[4] = {0, 2, 0, 0}, scale[3] = {1, 1, 1};
  float base[4] = {0, 0, 0, 0.5f}, rest[3] = {1, 2, 3};
  auto columns = sized<StippleCloudColumns>();
  columns.count = 1;
  columns.sh_degree = 1;
  columns.positions = position;
  columns.rotations = rotation;
  columns.scales = scale;
  columns.base = base;
  columns.rest[0] = columns.rest[1] = rest;
  StippleCloud* cloud = nullptr;
  expectInvalid(stipple_cloud_create_from_columns(context_, &columns, &cloud),
                "columns->rest[2] is NULL");
  columns.rest[2] = rest;
  base[3] = 1.5f;
  expectInvalid(stipple_cloud_create_from_columns(context_, &columns, &cloud), "0 to 1 is allowed");
  base[3] = 0.5f;
  columns.sh_degree = 5;
  expectInvalid(stipple_cloud_create_from_columns(context_, &columns, &cloud),
                "columns->sh_degree is 5; 0 to 4 is allowed");
  columns.sh_degree = 1;
  columns.frame = 99;
  expectInvalid(stipple_cloud_create_from_columns(context_, &columns, &cloud),
                "columns->frame is 99");
  columns.frame = STIPPLE_FRAME_RFU;
  EXPECT_EQ(cloud, nullptr);
  STIPPLE_ASSERT_OK(stipple_cloud_create_from_columns(context_, &columns, &cloud));
  auto buffers = sized<StippleCloudColumnBuffers>();
  buffers.rotations = rotation;
  EXPECT_EQ(stipple_cloud_read_columns(cloud, &buffers), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  buffers.capacity = 1;
  STIPPLE_EXPECT_OK(stipple_cloud_read_columns(cloud, &buffers));
  EXPECT_EQ(rotation[1], 1.0f);  // normalised on entry
  stipple_cloud_free(cloud);
}

TEST_F(BadInput, EveryArrayOfACloudIsHeldToItsRange) {
  const float nan = static_cast<float>(kNan), infinity = static_cast<float>(kInfinity);
  const struct {
    size_t array;
    float value;
    const char* message;
  } cases[] = {{0, nan, "position of splat 0"},     {0, infinity, "position of splat 0"},
               {1, nan, "rotation of splat 0"},     {1, -infinity, "rotation of splat 0"},
               {2, nan, "scale of splat 0"},        {2, infinity, "scale of splat 0"},
               {2, -1, "it must not be negative"},  {3, nan, "opacity of splat 0"},
               {3, 1.5f, "is 1.500000; 0 to 1 is"}, {3, -0.5f, "is -0.500000; 0 to 1 is"},
               {4, nan, "colour of splat 0"},       {4, infinity, "colour of splat 0"}};
  for (const auto& c : cases) {
    std::vector<float> values[5] = {{0, 0, 0}, {1, 0, 0, 0}, {1, 1, 1}, {0.5f}, {0, 0, 0}};
    values[c.array].back() = c.value;
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = 1;
    arrays.positions = values[0].data();
    arrays.rotations = values[1].data();
    arrays.scales = values[2].data();
    arrays.opacities = values[3].data();
    arrays.sh = values[4].data();
    StippleCloud* made = nullptr;
    expectInvalid(stipple_cloud_create(context_, &arrays, &made), c.message);
    EXPECT_EQ(made, nullptr);
    for (std::vector<float>& array : values) std::fill(array.begin(), array.end(), 0.0f);
    expectInvalid(stipple_cloud_create(context_, &arrays, &made), "is the zero quaternion");
    arrays.sh_degree = 5;
    expectInvalid(stipple_cloud_create(context_, &arrays, &made), "sh_degree is 5; 0 to 4");
    arrays.sh_degree = 0;
    arrays.scales = nullptr;
    expectInvalid(stipple_cloud_create(context_, &arrays, &made), "arrays->scales is NULL");
  }
}

TEST_F(BadInput, AQuaternionIsBroughtToUnitLength) {
  const float position[3] = {0, 0, 0}, rotation[4] = {0, 3, 0, -4}, scale[3] = {1, 1, 0};
  const float opacity = 0.5f, sh[3] = {0, 0, 0};
  auto arrays = sized<StippleCloudArrays>();
  arrays.count = 1;
  arrays.positions = position;
  arrays.rotations = rotation;
  arrays.scales = scale;
  arrays.opacities = &opacity;
  arrays.sh = sh;
  StippleCloud* cloud = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_create(context_, &arrays, &cloud));
  float seen[4] = {};
  auto buffers = sized<StippleCloudBuffers>();
  buffers.capacity = 1;
  buffers.rotations = seen;
  STIPPLE_ASSERT_OK(stipple_cloud_read(cloud, &buffers));
  EXPECT_EQ(seen[1], 0.6f);
  EXPECT_EQ(seen[3], -0.8f);
  STIPPLE_EXPECT_OK(draw(placed(cloud), frontCamera()));  // a scale of zero is drawn
  stipple_cloud_free(cloud);
}

TEST_F(BadInput, ACloudOfNothingLeavesTheBackground) {
  auto arrays = sized<StippleCloudArrays>();
  StippleCloud* empty = nullptr;
  STIPPLE_ASSERT_OK(stipple_cloud_create(context_, &arrays, &empty));
  options_.with_background = 1;
  options_.background[0] = 0.25;
  options_.output_colour = STIPPLE_OUTPUT_COMPOSITED;
  const std::vector<float> colour = render(context_, empty, options_, frontCamera());
  for (size_t i = 0; i < colour.size(); i += 4) {
    ASSERT_EQ(colour[i], 0.25f);
    ASSERT_EQ(colour[i + 1], 0.0f);
    ASSERT_EQ(colour[i + 3], 1.0f);
  }
  stipple_cloud_free(empty);
}

TEST_F(BadInput, APictureThatNeedsTooMuchMemoryIsRefusedWithItsNumbers) {
  StippleContextOptions limited;
  stipple_context_options_init(&limited);
  limited.memory_limit_bytes = 200 << 20;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&limited, &context));
  StippleRenderer* renderer = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(context, &renderer));
  const StippleInstance instance = placed(cloud_);
  StippleCamera camera = frontCamera();
  STIPPLE_EXPECT_OK(draw(renderer, &instance, 1, camera, sized<StippleRenderBuffers>()));

  // Many copies of a splat, each of which could cover every tile: the list of pairs is the most.
  const std::vector<StippleInstance> copies(1000, instance);
  camera.width = camera.height = 3000;
  uint64_t bytes = 0;
  STIPPLE_ASSERT_OK(stipple_renderer_memory_bound(renderer, copies.data(), 1000, &camera, &bytes));
  EXPECT_GT(bytes, limited.memory_limit_bytes);
  EXPECT_EQ(draw(renderer, copies.data(), 1000, camera, sized<StippleRenderBuffers>()),
            STIPPLE_ERROR_MEMORY_LIMIT);
  const std::string message = stipple_last_error_message();
  EXPECT_THAT(message, HasSubstr("this image of 3000 x 3000 pixels would need up to "));
  // 2^25 pairs of 4 bytes are held at once, and one huge page.
  EXPECT_THAT(message, HasSubstr("130.00 MiB of it for pairs of splat and tile"));
  EXPECT_THAT(message, HasSubstr("; the memory limit is 200.00 MiB"));
  stipple_renderer_free(renderer);
  stipple_context_free(context);
}

TEST_F(BadInput, APictureLargerThanTheMachineIsRefusedWithoutALimitOfTheCallers) {
  StippleCamera camera = frontCamera();
  camera.width = camera.height = 65536;
  const StippleInstance instance = placed(cloud_);
  uint64_t bytes = 0;
  STIPPLE_ASSERT_OK(stipple_renderer_memory_bound(renderer_, &instance, 1, &camera, &bytes));
  const StippleStatus status = [&] {
    StippleJob* job = nullptr;
    const auto buffers = sized<StippleRenderBuffers>();
    const StippleStatus started =
        stipple_renderer_render_start(renderer_, &instance, 1, &camera, &options_, &buffers, &job);
    stipple_job_free(job);  // a machine that could draw it does not have to
    return started;
  }();
  if (status == STIPPLE_OK) GTEST_SKIP() << "this machine has more than " << bytes << " bytes";
  EXPECT_EQ(status, STIPPLE_ERROR_MEMORY_LIMIT);
  EXPECT_THAT(stipple_last_error_message(), HasSubstr("; the memory limit is "));
}

}  // namespace
}  // namespace stipple::test
