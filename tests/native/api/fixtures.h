#pragma once

#include <gtest/gtest.h>
#include <stipple/stipple.h>

#include <cstdint>
#include <memory>
#include <vector>

namespace stipple::test {

#define STIPPLE_EXPECT_OK(call) EXPECT_EQ(call, STIPPLE_OK) << stipple_last_error_message()
#define STIPPLE_ASSERT_OK(call) ASSERT_EQ(call, STIPPLE_OK) << stipple_last_error_message()

template <typename T>
T sized() {
  T value = {};
  value.struct_size = sizeof(T);
  return value;
}

/// A unit cube of 12 triangles in one part, grey.
struct CubeArrays {
  std::vector<float> positions;
  std::vector<uint32_t> triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                     2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  CubeArrays() {
    for (uint32_t i = 0; i < 8; ++i) {
      for (uint32_t axis = 0; axis < 3; ++axis) {
        positions.push_back((i >> axis & 1) ? 0.5f : -0.5f);
      }
    }
  }
  StippleMeshPart part() const {
    auto made = sized<StippleMeshPart>();
    made.vertex_count = 8;
    made.triangle_count = 12;
    made.positions = positions.data();
    made.triangles = triangles.data();
    for (int i = 0; i < 4; ++i) made.matrix[i * 5] = 1.0;
    return made;
  }
};

/// Looks along -z of the world at the origin from 3 m, 64 x 48 pixels.
inline StippleCamera frontCamera() {
  auto camera = sized<StippleCamera>();
  camera.width = 64;
  camera.height = 48;
  camera.fx = camera.fy = 60;
  camera.cx = 32;
  camera.cy = 24;
  const double matrix[16] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 3, 0, 0, 0, 1};
  for (int i = 0; i < 16; ++i) camera.world_to_camera[i] = matrix[i];
  camera.near_plane = 0.01;
  camera.far_plane = 1000;
  return camera;
}

class ApiTest : public ::testing::Test {
 protected:
  void SetUp() override { STIPPLE_ASSERT_OK(stipple_context_create(nullptr, &context_)); }
  void TearDown() override { stipple_context_free(context_); }

  StippleContext* withThreadCount(uint32_t threads) {
    StippleContextOptions options;
    stipple_context_options_init(&options);
    options.thread_count = threads;
    StippleContext* made = nullptr;
    STIPPLE_EXPECT_OK(stipple_context_create(&options, &made));
    return made;
  }

  StippleMesh* cube(StippleContext* context) {
    StippleMesh* mesh = nullptr;
    STIPPLE_EXPECT_OK(stipple_mesh_create(context, &mesh));
    const StippleMeshPart part = cube_.part();
    STIPPLE_EXPECT_OK(stipple_mesh_add_part(mesh, &part));
    return mesh;
  }

  StippleModel* cubeModel(StippleContext* context) {
    StippleMesh* mesh = cube(context);
    StippleModelFromMeshOptions options;
    stipple_model_from_mesh_options_init(&options);
    options.sample_count = 20000;
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_model_from_mesh_start(context, mesh, &options, &job));
    stipple_mesh_free(mesh);  // the job holds its own share
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    StippleModel* model = nullptr;
    STIPPLE_EXPECT_OK(stipple_job_model(job, &model));
    stipple_job_free(job);
    return model;
  }

  StippleCloud* cubeSplats(StippleContext* context, uint64_t anchors) {
    StippleModel* model = cubeModel(context);
    StippleDecodeOptions options;
    stipple_decode_options_init(&options);
    options.anchor_count = anchors;
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_model_decode(model, &options, &cloud));
    stipple_model_free(model);
    return cloud;
  }

  /// One splat of the given display colour, opaque, 0.3 m wide, at the origin.
  StippleCloud* oneSplat(float red, float green, float blue, float opacity = 0.9f) {
    const float position[3] = {0, 0, 0}, rotation[4] = {1, 0, 0, 0}, scale[3] = {0.3f, 0.3f, 0.3f};
    constexpr float kC0 = 0.28209479177387814f;
    const float sh[3] = {(red - 0.5f) / kC0, (green - 0.5f) / kC0, (blue - 0.5f) / kC0};
    auto arrays = sized<StippleCloudArrays>();
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

  static StippleInstance placed(const StippleCloud* cloud) {
    auto instance = sized<StippleInstance>();
    instance.cloud = cloud;
    for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
    return instance;
  }

  /// [H,W,4] of one cloud.
  std::vector<float> render(StippleContext* context, const StippleCloud* cloud,
                            const StippleRenderOptions& options, const StippleCamera& camera) {
    std::vector<float> colour(size_t{camera.width} * camera.height * 4, -1.0f);
    auto buffers = sized<StippleRenderBuffers>();
    buffers.colour = colour.data();
    const StippleInstance instance = placed(cloud);
    StippleRenderer* renderer = nullptr;
    STIPPLE_EXPECT_OK(stipple_renderer_create(context, &renderer));
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(
        stipple_renderer_render_start(renderer, &instance, 1, &camera, &options, &buffers, &job));
    stipple_renderer_free(renderer);
    STIPPLE_EXPECT_OK(stipple_job_wait(job));
    stipple_job_free(job);
    return colour;
  }

  StippleContext* context_ = nullptr;
  CubeArrays cube_;
};

}  // namespace stipple::test
