#include <cmath>
#include <cstddef>
#include <string>

#include "api/fixtures.h"

// Cameras of directions, lenses, shutters and passes through the C header; callers that are older
// than these.

namespace stipple::test {
namespace {

class EffectsApi : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    cloud_ = oneSplat(0.8f, 0.3f, 0.6f, 0.5f);
    stipple_render_options_init(&options_);
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    ApiTest::TearDown();
  }

  StippleStatus draw(const StippleRenderBuffers& buffers) {
    const StippleInstance instance = placed(cloud_);
    StippleRenderer* renderer = nullptr;
    EXPECT_EQ(stipple_renderer_create(context_, &renderer), STIPPLE_OK);
    StippleJob* job = nullptr;
    StippleStatus status =
        stipple_renderer_render_start(renderer, &instance, 1, &camera_, &options_, &buffers, &job);
    message_ = stipple_last_error_message();
    if (status == STIPPLE_OK) {
      status = stipple_job_wait(job);
      message_ = stipple_last_error_message();
    }
    stipple_job_free(job);
    stipple_renderer_free(renderer);
    return status;
  }

  std::vector<float> colours() {
    std::vector<float> colour(kPixels * 4, -1.0f);
    auto buffers = sized<StippleRenderBuffers>();
    buffers.colour = colour.data();
    EXPECT_EQ(draw(buffers), STIPPLE_OK) << message_;
    return colour;
  }

  std::string refusal() {
    auto buffers = sized<StippleRenderBuffers>();
    EXPECT_EQ(draw(buffers), STIPPLE_ERROR_INVALID_ARGUMENT);
    return message_;
  }

  static constexpr size_t kPixels = 64 * 48;
  StippleCamera camera_ = frontCamera();
  StippleCloud* cloud_ = nullptr;
  StippleRenderOptions options_;
  std::string message_;
};

TEST_F(EffectsApi, CallersWithoutThemGetWhatTheyGot) {
  const std::vector<float> now = colours();
  // Fields after the end of an older struct are not read, whatever lies there.
  options_.samples = 7777777;
  options_.struct_size = offsetof(StippleRenderOptions, accuracy);
  camera_.field_of_view = std::nan("");
  camera_.struct_size = offsetof(StippleCamera, field_of_view);
  std::vector<float> colour(kPixels * 4);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.struct_size = offsetof(StippleRenderBuffers, normal);
  buffers.colour = colour.data();
  buffers.normal = reinterpret_cast<float*>(8);
  ASSERT_EQ(draw(buffers), STIPPLE_OK) << message_;
  EXPECT_EQ(colour, now);
}

TEST_F(EffectsApi, OneSampleIsThePictureAndManyAreItsMean) {
  const std::vector<float> plain = colours();
  auto lens = sized<StippleAperture>();
  lens.aperture_radius = 0.3;
  lens.focus_distance = 1.5;
  options_.aperture = &lens;
  options_.samples = 1;
  EXPECT_EQ(colours(), plain);
  options_.samples = 64;
  const std::vector<float> blurred = colours();
  double sum = 0, blurred_sum = 0;
  for (size_t i = 0; i < kPixels; ++i) {
    sum += static_cast<double>(plain[i * 4 + 3]);
    blurred_sum += static_cast<double>(blurred[i * 4 + 3]);
  }
  EXPECT_NEAR(blurred_sum, sum, 0.05 * sum);
  EXPECT_LT(blurred[(24 * 64 + 32) * 4 + 3], 0.8f * plain[(24 * 64 + 32) * 4 + 3]);
  // All methods take part.
  for (const uint32_t method : {STIPPLE_RENDER_REFERENCE, STIPPLE_RENDER_RAYS}) {
    options_.method = method;
    const std::vector<float> other = colours();
    for (size_t i = 0; i < kPixels * 4; ++i) ASSERT_NEAR(other[i], blurred[i], 0.01f);
  }
}

TEST_F(EffectsApi, TheWholeFisheyeIsThereAndNoMore) {
  camera_.model = STIPPLE_CAMERA_FISHEYE_EQUISOLID;
  camera_.fx = camera_.fy = 24;
  camera_.field_of_view = 3.0;
  EXPECT_EQ(refusal(),
            "the affine projection of splats needs a perspective or orthographic camera; this one "
            "is fisheye equisolid, which is drawn along rays only");
  options_.method = STIPPLE_RENDER_RAYS;
  options_.with_background = 1;
  options_.background[0] = 1;
  const std::vector<float> colour = colours();
  EXPECT_EQ(colour[3], 0.0f);
  EXPECT_EQ(colour[(24 * 64 + 32) * 4 + 3], 1.0f);
  // Rays may be asked for by their accuracy too.
  options_.method = STIPPLE_RENDER_TILED;
  StippleAccuracy accuracy;
  STIPPLE_ASSERT_OK(stipple_accuracy_init(STIPPLE_ACCURACY_FINAL, &accuracy));
  accuracy.projection = STIPPLE_PROJECTION_RAY;
  accuracy.order = STIPPLE_ORDER_PIXEL;
  options_.accuracy = &accuracy;
  EXPECT_EQ(colours(), colour);
  camera_.field_of_view = 6.981317;  // 400 degrees
  EXPECT_EQ(refusal(), "the fisheye's field of view is 400 degrees; 0 to 360 is allowed");
}

TEST_F(EffectsApi, NormalsAndObjectsAreThereForTheAsking) {
  std::vector<float> normal(kPixels * 3);
  std::vector<uint32_t> objects(kPixels, 9);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.normal = normal.data();
  buffers.object_index = objects.data();
  auto lens = sized<StippleAperture>();
  lens.aperture_radius = 0.3;
  lens.focus_distance = 1.5;
  std::vector<uint32_t> sharp;
  for (const uint32_t samples : {0u, 8u}) {
    options_.samples = samples;
    options_.aperture = samples > 0 ? &lens : nullptr;
    ASSERT_EQ(draw(buffers), STIPPLE_OK) << message_;
    const size_t centre = 24 * 64 + 32;
    EXPECT_EQ(objects[centre], 1u);
    EXPECT_EQ(objects[0], 0u);
    EXPECT_NEAR(std::hypot(normal[centre * 3], normal[centre * 3 + 1], normal[centre * 3 + 2]),
                1.0f, 1e-5f);
    EXPECT_GT(normal[centre * 3 + 2], -1e-6f);  // to the camera, which looks along -z
    // Those of the middle of the lens.
    if (samples == 0) sharp = objects;
    EXPECT_EQ(objects, sharp);
  }
}

TEST_F(EffectsApi, LensesAndShuttersThatAreNoneAreRefused) {
  auto lens = sized<StippleAperture>();
  lens.aperture_radius = 0.1;
  options_.aperture = &lens;
  EXPECT_EQ(refusal(), "the lens's focus distance is 0; 1e-6 to 1e15 m is allowed");
  lens.focus_distance = 1;
  lens.blades = 2;
  EXPECT_EQ(refusal(), "the lens's number of blades is 2; 0 (round) or 3 to 64 is allowed");
  options_.aperture = nullptr;
  auto shutter = sized<StippleShutter>();
  shutter.step_count = 1;
  options_.shutter = &shutter;
  EXPECT_EQ(refusal(), "options->shutter->step_count is 1; 2 to 1025 is allowed");
  shutter.step_count = 2;
  double cameras[32] = {};
  shutter.cameras = cameras;
  EXPECT_NE(refusal().find("not a rotation"), std::string::npos);
  options_.shutter = nullptr;
  options_.samples = 100000;
  EXPECT_EQ(refusal(), "samples is 100000; 0 to 65536 is allowed");
}

TEST_F(EffectsApi, ASplatThatMovesByItsCloudsIsAnObjectThatMoves) {
  const std::vector<float> sharp = colours();
  StippleCloud* after = nullptr;
  const double shift[16] = {1, 0, 0, 0.4, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  STIPPLE_ASSERT_OK(stipple_cloud_transform(cloud_, shift, &after));
  auto shutter = sized<StippleShutter>();
  shutter.step_count = 2;
  double matrices[32] = {};
  const StippleInstance instance = placed(cloud_);
  std::copy_n(instance.matrix, 16, matrices);
  std::copy_n(shift, 16, matrices + 16);
  shutter.instances = matrices;
  options_.shutter = &shutter;
  options_.samples = 64;
  const std::vector<float> by_matrices = colours();
  const StippleCloud* clouds[2] = {nullptr, after};
  shutter.instances = nullptr;
  shutter.clouds = clouds;
  const std::vector<float> by_clouds = colours();
  EXPECT_NE(by_clouds, sharp);
  // Places are float32 in the clouds and double in the matrices.
  for (size_t i = 0; i < kPixels * 4; ++i) ASSERT_NEAR(by_clouds[i], by_matrices[i], 1e-4f);
  // The clouds of the steps are shared with the job, and may be freed when it has been started.
  auto buffers = sized<StippleRenderBuffers>();
  std::vector<float> colour(kPixels * 4);
  buffers.colour = colour.data();
  StippleRenderer* renderer = nullptr;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer));
  uint32_t samples = 0;
  options_.samples = 0;
  STIPPLE_ASSERT_OK(
      stipple_renderer_sample_count(renderer, &instance, 1, &camera_, &options_, &samples));
  EXPECT_EQ(samples, 16u);
  options_.samples = 64;
  STIPPLE_ASSERT_OK(
      stipple_renderer_render_start(renderer, &instance, 1, &camera_, &options_, &buffers, &job));
  stipple_cloud_free(after);
  STIPPLE_ASSERT_OK(stipple_job_wait(job));
  EXPECT_EQ(colour, by_clouds);
  stipple_job_free(job);
  stipple_renderer_free(renderer);
  // Who is older than the clouds has none, whatever lies behind the end of his struct.
  shutter.struct_size = offsetof(StippleShutter, clouds);
  shutter.clouds = reinterpret_cast<const StippleCloud* const*>(8);
  shutter.instances = matrices;
  EXPECT_EQ(colours(), by_matrices);
  shutter.struct_size = 16;
  EXPECT_NE(refusal().find("options->shutter"), std::string::npos);
}

TEST_F(EffectsApi, CloudsOfAShutterThatHoldOtherSplatsAreRefused) {
  StippleCloud* two = nullptr;
  const StippleInstance pair[2] = {placed(cloud_), placed(cloud_)};
  STIPPLE_ASSERT_OK(stipple_cloud_merge(pair, 2, STIPPLE_FRAME_UNKNOWN, &two));
  const StippleCloud* clouds[3] = {cloud_, nullptr, two};
  auto shutter = sized<StippleShutter>();
  shutter.step_count = 3;
  shutter.clouds = clouds;
  options_.shutter = &shutter;
  EXPECT_EQ(refusal(),
            "instance 0: the cloud of step 2 has 2 splats of harmonic degree 0; those of the "
            "instance itself are 1 of degree 0, and all of its steps must have the same splats");
  stipple_cloud_free(two);
}

}  // namespace
}  // namespace stipple::test
