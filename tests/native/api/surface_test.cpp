#include <cmath>
#include <limits>
#include <string>

#include "api/fixtures.h"

// A surface between splats through the C header: what is done in which colour space.

namespace stipple::test {
namespace {

class SurfaceApi : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    cloud_ = oneSplat(0.8f, 0.3f, 0.6f, 0.5f);
    stipple_render_options_init(&options_);
    depth_.assign(kPixels, 4.0f);
    for (size_t i = 0; i < kPixels; ++i) {
      colour_.insert(colour_.end(), {0.1f, 3.0f, 0.2f, 0.75f});
      light_.insert(light_.end(), {0.25f, 0.5f, 1.0f});
    }
    options_.surface_width = 64;
    options_.surface_height = 48;
    options_.surface_depth = depth_.data();
    options_.surface_colour = colour_.data();
  }
  void TearDown() override {
    stipple_cloud_free(cloud_);
    ApiTest::TearDown();
  }

  std::string refusal(const StippleRenderOptions& options) {
    const StippleInstance instance = placed(cloud_);
    auto buffers = sized<StippleRenderBuffers>();
    StippleRenderer* renderer = nullptr;
    EXPECT_EQ(stipple_renderer_create(context_, &renderer), STIPPLE_OK);
    StippleJob* job = nullptr;
    EXPECT_EQ(
        stipple_renderer_render_start(renderer, &instance, 1, &camera_, &options, &buffers, &job),
        STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(job, nullptr);
    stipple_renderer_free(renderer);
    return stipple_last_error_message();
  }

  static constexpr size_t kPixels = 64 * 48;
  StippleCamera camera_ = frontCamera();
  StippleCloud* cloud_ = nullptr;
  StippleRenderOptions options_;
  std::vector<float> depth_, colour_, light_;
};

TEST_F(SurfaceApi, IsAddedToSplatsThatAreLightAlready) {
  options_.splat_light = light_.data();
  for (const uint32_t method : {STIPPLE_RENDER_TILED, STIPPLE_RENDER_REFERENCE}) {
    options_.method = method;
    StippleRenderOptions plain;
    stipple_render_options_init(&plain);
    plain.method = method;
    const std::vector<float> splats = render(context_, cloud_, plain, camera_);
    const std::vector<float> both = render(context_, cloud_, options_, camera_);
    for (size_t i = 0; i < kPixels; ++i) {
      // The splat is in front of the surface.
      const float left = 1.0f - splats[i * 4 + 3];
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(both[i * 4 + c],
                    light_[i * 3 + c] * splats[i * 4 + c] + left * colour_[i * 4 + c], 2e-6);
      }
      EXPECT_NEAR(both[i * 4 + 3], splats[i * 4 + 3] + left * 0.75f, 1e-6);
      if (splats[i * 4 + 3] == 0.0f) {
        EXPECT_EQ(both[i * 4 + 1], 3.0f);
      }
    }
  }
}

TEST_F(SurfaceApi, HoldoutsAreHolesInSceneLinearPictures) {
  // Of splats at one depth the first comes first: it holds the second out. Composited as display
  // values.
  StippleCloud* behind = oneSplat(0.2f, 0.7f, 0.4f, 0.5f);
  StippleInstance instances[] = {placed(cloud_), placed(behind)};
  instances[0].holdout = 1;
  StippleRenderer* renderer = nullptr;
  STIPPLE_ASSERT_OK(stipple_renderer_create(context_, &renderer));
  std::vector<float> colour(kPixels * 4), depth(kPixels), transmittance(kPixels);
  auto buffers = sized<StippleRenderBuffers>();
  buffers.colour = colour.data();
  buffers.depth = depth.data();
  buffers.transmittance = transmittance.data();
  for (const uint32_t method : {STIPPLE_RENDER_TILED, STIPPLE_RENDER_REFERENCE}) {
    StippleRenderOptions plain;
    stipple_render_options_init(&plain);
    plain.method = method;
    const std::vector<float> own = render(context_, behind, plain, camera_);
    StippleJob* job = nullptr;
    STIPPLE_ASSERT_OK(
        stipple_renderer_render_start(renderer, instances, 2, &camera_, &plain, &buffers, &job));
    STIPPLE_ASSERT_OK(stipple_job_wait(job));
    stipple_job_free(job);
    size_t seen = 0;
    for (size_t i = 0; i < kPixels; ++i) {
      if (colour[i * 4 + 3] < 0.02f) continue;
      ++seen;
      // What shows has the splat's own colour, whatever its alpha.
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(colour[i * 4 + c] / colour[i * 4 + 3], own[i * 4 + c] / own[i * 4 + 3], 1e-4);
      }
      EXPECT_LT(colour[i * 4 + 3] + transmittance[i], 1.0f);
    }
    EXPECT_GT(seen, 20u);
  }
  instances[1].holdout = 2;
  StippleJob* job = nullptr;
  EXPECT_EQ(
      stipple_renderer_render_start(renderer, instances, 2, &camera_, nullptr, &buffers, &job),
      STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(), "instances[1].holdout is 2; 0 to 1 is allowed");
  stipple_renderer_free(renderer);
  stipple_cloud_free(behind);
}

TEST_F(SurfaceApi, LetsABackgroundThroughWhereItIsTransparent) {
  for (float& z : depth_) z = 1.0f;  // before the splat
  options_.with_background = 1;
  options_.background[0] = 0.5;
  const std::vector<float> both = render(context_, cloud_, options_, camera_);
  // A corner without the splat: 1/4 of the background behind the surface, in light.
  EXPECT_NEAR(both[0], 0.25f * 0.5f + 0.1f, 1e-6);
  EXPECT_NEAR(both[3], 1.0f, 1e-6);
}

TEST_F(SurfaceApi, IsAMatteWithoutAColour) {
  options_.surface_colour = nullptr;
  for (size_t i = 0; i < kPixels; ++i) depth_[i] = i % 2 ? 1.0f : 1e10f;
  StippleRenderOptions plain;
  stipple_render_options_init(&plain);
  const std::vector<float> splats = render(context_, cloud_, plain, camera_);
  const std::vector<float> both = render(context_, cloud_, options_, camera_);
  for (size_t i = 0; i < kPixels * 4; ++i) {
    EXPECT_EQ(both[i], i / 4 % 2 ? 0.0f : splats[i]);
  }
}

TEST_F(SurfaceApi, OfAnOlderCallerIsNone) {
  StippleRenderOptions older = options_;
  older.struct_size = offsetof(StippleRenderOptions, surface_width);
  StippleRenderOptions plain;
  stipple_render_options_init(&plain);
  EXPECT_EQ(render(context_, cloud_, older, camera_), render(context_, cloud_, plain, camera_));
}

TEST_F(SurfaceApi, IsRefusedInOneSentence) {
  StippleRenderOptions other = options_;
  other.surface_width = 63;
  EXPECT_EQ(refusal(other), "the surface is 63 x 48 pixels; it must have the image's 64 x 48");
  other = options_;
  other.splat_light = light_.data();
  light_[7] = -1.0f;
  EXPECT_NE(refusal(other).find("splat_light at pixel 2 is -1"), std::string::npos);
  light_[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(refusal(other).find("splat_light"), std::string::npos);
  depth_[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(refusal(options_).find("depth at pixel (5, 0) is nan"), std::string::npos);
}

TEST_F(SurfaceApi, ComesFromMeshesByTheirDepth) {
  StippleMesh* mesh = cube(context_);
  auto instance = sized<StippleMeshInstance>();
  instance.mesh = mesh;
  for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
  StippleJob* job = nullptr;
  STIPPLE_ASSERT_OK(
      stipple_mesh_depth_start(context_, &instance, 1, &camera_, depth_.data(), &job));
  stipple_mesh_free(mesh);  // the job holds its own share
  STIPPLE_EXPECT_OK(stipple_job_wait(job));
  stipple_job_free(job);
  // The cube's front face is 2.5 m away and 24 pixels wide.
  EXPECT_NEAR(depth_[24 * 64 + 32], 2.5f, 1e-6);
  EXPECT_NEAR(depth_[24 * 64 + 32 + 11], 2.5f, 1e-6);
  EXPECT_EQ(depth_[24 * 64 + 32 + 12], 1e10f);
  mesh = cube(context_);
  instance.mesh = mesh;
  instance.matrix[0] = std::nan("");
  EXPECT_EQ(stipple_mesh_depth_start(context_, &instance, 1, &camera_, depth_.data(), &job),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_mesh_free(mesh);
}

}  // namespace
}  // namespace stipple::test
