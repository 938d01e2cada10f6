#pragma once

#include <stipple/stipple.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "fixtures.h"

namespace stipple::test {

inline constexpr int kViewCount = 12;

/// Pictures of three splats from a ring of cameras, and where those splats are.
class FitViewsTest : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    std::string pattern = (std::filesystem::temp_directory_path() / "stipple_fit_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &views_));
    addViews(views_, 1.0f);
  }
  void TearDown() override {
    stipple_views_free(views_);
    std::filesystem::remove_all(folder_);
    ApiTest::TearDown();
  }

  StippleCloud* scene() {
    const float positions[9] = {-0.3f, 0, 0, 0.3f, 0.1f, 0, 0, -0.2f, 0.3f};
    const float rotations[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const float scales[9] = {0.15f, 0.15f, 0.15f, 0.2f, 0.1f, 0.1f, 0.1f, 0.1f, 0.2f};
    const float opacities[3] = {0.9f, 0.8f, 0.95f};
    const float sh[9] = {1.2f, -1, -1, -1, 1.2f, -1, -1, -1, 1.5f};
    auto arrays = sized<StippleCloudArrays>();
    arrays.count = 3;
    arrays.positions = positions;
    arrays.rotations = rotations;
    arrays.scales = scales;
    arrays.opacities = opacities;
    arrays.sh = sh;
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_cloud_create(context_, &arrays, &cloud));
    return cloud;
  }

  /// In: brightness, a factor of all colours; 0 makes black pictures; seconds from one view to the
  /// next; teaches: else nothing can be learned from them: the first looks away, and no pixel of
  /// the others counts.
  void addViews(StippleViews* views, float brightness, double seconds = 0, bool teaches = true) {
    StippleCloud* cloud = scene();
    StippleRenderOptions render_options;
    stipple_render_options_init(&render_options);
    render_options.output_colour = STIPPLE_OUTPUT_COMPOSITED;
    for (int v = 0; v < kViewCount; ++v) {
      const double angle = 2 * 3.141592653589793 * v / kViewCount;
      StippleCamera camera = frontCamera();
      const double c = std::cos(angle), s = std::sin(angle);
      // The front camera, with the world turned about y.
      const double matrix[16] = {c, 0, s, 0, 0, -1, 0, 0, s, 0, -c, 3, 0, 0, 0, 1};
      std::copy(matrix, matrix + 16, camera.world_to_camera);
      std::vector<float> rgba = render(context_, cloud, render_options, camera);
      for (size_t i = 0; i < rgba.size(); ++i) {
        if (brightness == 0) rgba[i] = i % 4 == 3 ? 1.0f : 0.0f;
      }
      auto picture = sized<StippleViewImage>();
      picture.transfer = STIPPLE_TRANSFER_SRGB;
      picture.rgba = rgba.data();
      picture.time = v * seconds;
      const std::vector<float> nothing(rgba.size() / 4, 0.0f);
      if (!teaches && v > 0) picture.weights = nothing.data();
      for (int i = 0; i < 12 && !teaches && v == 0; ++i) {
        if (i / 4 != 1) camera.world_to_camera[i] *= -1;
      }
      const std::string name = std::to_string(100 + v);
      STIPPLE_ASSERT_OK(stipple_views_add(views, &camera, &picture, name.c_str()));
    }
    stipple_cloud_free(cloud);
    const float positions[9] = {-0.3f, 0, 0, 0.3f, 0.1f, 0, 0, -0.2f, 0.3f};
    const float colours[9] = {0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f};
    auto points = sized<StippleViewPoints>();
    points.count = 3;
    points.positions = positions;
    points.colours = colours;
    STIPPLE_ASSERT_OK(stipple_views_set_points(views, &points));
  }

  std::string path(const char* name) const { return (folder_ / name).string(); }

  /// Every number of a cloud without view-dependent colour; frees it.
  static std::vector<float> taken(StippleCloud* cloud) {
    auto info = sized<StippleCloudInfo>();
    STIPPLE_EXPECT_OK(stipple_cloud_info(cloud, &info));
    const uint64_t n = info.count;
    std::vector<float> all(n * (3 + 4 + 3 + 1 + 3));
    auto buffers = sized<StippleCloudBuffers>();
    buffers.capacity = n;
    buffers.positions = all.data();
    buffers.rotations = buffers.positions + 3 * n;
    buffers.scales = buffers.rotations + 4 * n;
    buffers.opacities = buffers.scales + 3 * n;
    buffers.sh = buffers.opacities + n;
    STIPPLE_EXPECT_OK(stipple_cloud_read(cloud, &buffers));
    stipple_cloud_free(cloud);
    return all;
  }

  static void expectRefused(StippleStatus seen, StippleStatus wanted, const char* text) {
    EXPECT_EQ(seen, wanted);
    EXPECT_NE(std::string(stipple_last_error_message()).find(text), std::string::npos)
        << stipple_last_error_message();
  }

  std::filesystem::path folder_;
  StippleViews* views_ = nullptr;
};

/// A fit of them.
class FitTest : public FitViewsTest {
 protected:
  void SetUp() override {
    FitViewsTest::SetUp();
    stipple_fit_options_init(&options_);
    options_.iterations = 60;
    options_.max_splats = 200;
    options_.sh_degree = 0;
    options_.measure_interval = 10;
  }

  StippleJob* start() {
    StippleJob* job = nullptr;
    STIPPLE_EXPECT_OK(stipple_fit_start(context_, views_, &options_, &job));
    return job;
  }

  static StippleFitFigures figuresOf(const StippleJob* job) {
    auto figures = sized<StippleFitFigures>();
    STIPPLE_EXPECT_OK(stipple_fit_figures(job, &figures));
    return figures;
  }

  /// Every number of the result.
  static std::vector<float> result(const StippleJob* job) {
    StippleCloud* cloud = nullptr;
    STIPPLE_EXPECT_OK(stipple_fit_cloud(job, 0, &cloud));
    return taken(cloud);
  }

  static void waitForIteration(const StippleJob* job, uint64_t iteration) {
    for (int i = 0; i < 20000 && figuresOf(job).iteration < iteration; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  StippleFitOptions options_;
};

}  // namespace stipple::test
