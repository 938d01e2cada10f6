#include <gtest/gtest.h>

#include <stdlib.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "fixtures.h"

namespace stipple::test {
namespace {

class ViewsTest : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    STIPPLE_ASSERT_OK(stipple_views_create(context_, STIPPLE_COLOUR_DISPLAY, &views_));
    camera_.width = 2;
    camera_.height = 1;
  }
  void TearDown() override {
    stipple_views_free(views_);
    ApiTest::TearDown();
  }
  StippleViewImage picture(const float* rgba, uint32_t transfer = STIPPLE_TRANSFER_SRGB) const {
    auto made = sized<StippleViewImage>();
    made.transfer = transfer;
    made.rgba = rgba;
    return made;
  }

  StippleViews* views_ = nullptr;
  StippleCamera camera_ = frontCamera();
  const float rgba_[8] = {0.25f, 0.125f, 0.0f, 0.5f, 1.0f, 0.5f, 0.25f, 1.0f};
};

/// Numbers from 0 to 1 are kept in 16 bits, and come back in float32.
constexpr double kKept = 7.7e-6;

TEST_F(ViewsTest, GivesBackThePictureThatWasAdded) {
  const float depth[2] = {2.5f, 1e10f}, weights[2] = {0.0f, 1.0f};
  StippleViewImage given = picture(rgba_);
  given.depth = depth;
  given.weights = weights;
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, "left"));
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));

  auto info = sized<StippleViewsInfo>();
  STIPPLE_ASSERT_OK(stipple_views_info(views_, &info));
  EXPECT_EQ(info.view_count, 2u);
  EXPECT_EQ(info.has_images, 1u);
  EXPECT_EQ(info.colour_space, uint32_t{STIPPLE_COLOUR_DISPLAY});
  auto view = sized<StippleViewInfo>();
  STIPPLE_ASSERT_OK(stipple_views_view_info(views_, 0, &view));
  EXPECT_STREQ(view.name, "left");
  EXPECT_STREQ(view.camera_model, "PINHOLE");
  EXPECT_STREQ(view.image_path, "");
  STIPPLE_ASSERT_OK(stipple_views_view_info(views_, 1, &view));
  EXPECT_STREQ(view.name, "view 1");

  std::vector<float> rgba(8), depths(2), masks(2), normals(6, 9.0f);
  auto buffers = sized<StippleViewBuffers>();
  buffers.capacity = 2;
  buffers.rgba = rgba.data();
  buffers.depth = depths.data();
  buffers.weights = masks.data();
  buffers.normals = normals.data();
  STIPPLE_ASSERT_OK(stipple_views_read(views_, 0, &buffers));
  for (size_t i = 0; i < 8; ++i) EXPECT_NEAR(rgba[i], rgba_[i], kKept);
  EXPECT_EQ(depths, (std::vector<float>{2.5f, 0.0f}));
  EXPECT_EQ(masks, (std::vector<float>{0.0f, 1.0f}));
  EXPECT_EQ(normals, std::vector<float>(6, 0.0f));
}

TEST_F(ViewsTest, KnowsWhenAViewWasTakenAndWhatItIsFor) {
  StippleViewImage given = picture(rgba_);
  given.time = 0.125;
  given.split = STIPPLE_VIEW_SPLIT_TEST;
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));
  // A caller that was built before there were times: whatever lies behind his struct is not read.
  given.struct_size = offsetof(StippleViewImage, time);
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));
  auto view = sized<StippleViewInfo>();
  STIPPLE_ASSERT_OK(stipple_views_view_info(views_, 0, &view));
  EXPECT_EQ(view.time, 0.125);
  EXPECT_EQ(view.split, uint32_t{STIPPLE_VIEW_SPLIT_TEST});
  STIPPLE_ASSERT_OK(stipple_views_view_info(views_, 1, &view));
  EXPECT_EQ(view.time, 0);
  EXPECT_EQ(view.split, uint32_t{STIPPLE_VIEW_SPLIT_NONE});
  StippleViewInfo shorter = {};
  shorter.struct_size = offsetof(StippleViewInfo, time);
  shorter.time = 7;
  STIPPLE_ASSERT_OK(stipple_views_view_info(views_, 0, &shorter));
  EXPECT_EQ(shorter.time, 7);

  given.struct_size = offsetof(StippleViewImage, normals);
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  given.struct_size = sizeof(given);
  given.split = 4;
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(), "image->split is 4; 0 to 3 is allowed");
  given.split = 0;
  for (const double time :
       {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    given.time = time;
    EXPECT_EQ(stipple_views_add(views_, &camera_, &given, "late"), STIPPLE_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(stipple_last_error_message()).find("late: time"), std::string::npos);
  }
  uint64_t count = 0;
  STIPPLE_ASSERT_OK(stipple_views_count(views_, &count));
  EXPECT_EQ(count, 2u);
}

TEST_F(ViewsTest, BringsLinearPicturesIntoTheViewsColourSpace) {
  const StippleViewImage given = picture(rgba_, STIPPLE_TRANSFER_LINEAR);
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));
  std::vector<float> rgba(8);
  auto buffers = sized<StippleViewBuffers>();
  buffers.capacity = 2;
  buffers.rgba = rgba.data();
  STIPPLE_ASSERT_OK(stipple_views_read(views_, 0, &buffers));
  const auto encoded = [](double linear) { return 1.055 * std::pow(linear, 1 / 2.4) - 0.055; };
  // The curve belongs to the straight colour; pow in float32 leaves 1e-6.
  EXPECT_NEAR(rgba[0], 0.5 * encoded(0.5), kKept + 1e-6);
  EXPECT_NEAR(rgba[1], 0.5 * encoded(0.25), kKept + 1e-6);
  EXPECT_NEAR(rgba[5], encoded(0.5), kKept + 1e-6);
  EXPECT_NEAR(rgba[3], 0.5f, kKept);
}

TEST_F(ViewsTest, RefusesWhatCannotBeAPictureAndKeepsTheRest) {
  float bad[8];
  std::copy(rgba_, rgba_ + 8, bad);
  bad[5] = std::numeric_limits<float>::quiet_NaN();
  StippleViewImage given = picture(bad);
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, "n.exr"), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(),
               "n.exr: pixel (1, 0) has colour nan; a finite number is needed");
  given = picture(nullptr);
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  given = picture(rgba_);
  given.transfer = 2;
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  camera_.width = 0;
  given.transfer = 0;
  EXPECT_EQ(stipple_views_add(views_, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  uint64_t count = 9;
  STIPPLE_ASSERT_OK(stipple_views_count(views_, &count));
  EXPECT_EQ(count, 0u);
  auto view = sized<StippleViewInfo>();
  EXPECT_EQ(stipple_views_view_info(views_, 0, &view), STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stipple_views_create(context_, 2, &views_), STIPPLE_ERROR_INVALID_ARGUMENT);
}

TEST_F(ViewsTest, SaysWhatABufferNeeds) {
  const StippleViewImage given = picture(rgba_);
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));
  std::vector<float> rgba(4);
  auto buffers = sized<StippleViewBuffers>();
  buffers.capacity = 1;
  buffers.rgba = rgba.data();
  EXPECT_EQ(stipple_views_read(views_, 0, &buffers), STIPPLE_ERROR_BUFFER_TOO_SMALL);
  EXPECT_STREQ(stipple_last_error_message(), "capacity is 1 pixels; 2 are needed");
}

TEST_F(ViewsTest, RefusesAPictureAboveTheMemoryLimit) {
  StippleContextOptions options;
  stipple_context_options_init(&options);
  options.memory_limit_bytes = 1000;
  StippleContext* small = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&options, &small));
  StippleViews* views = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_create(small, STIPPLE_COLOUR_LINEAR, &views));
  camera_.width = camera_.height = 60000;
  const StippleViewImage given = picture(rgba_);
  EXPECT_EQ(stipple_views_add(views, &camera_, &given, nullptr), STIPPLE_ERROR_MEMORY_LIMIT);
  stipple_views_free(views);
  stipple_context_free(small);
}

TEST_F(ViewsTest, KeepsPoints) {
  const std::vector<float> positions = {1, 2, 3, 4, 5, 6}, colours = {0, 0.5f, 1, 1, 1, 1};
  auto points = sized<StippleViewPoints>();
  points.count = 2;
  points.positions = positions.data();
  points.colours = colours.data();
  STIPPLE_ASSERT_OK(stipple_views_set_points(views_, &points));
  std::vector<float> read_positions(6), read_colours(6);
  STIPPLE_ASSERT_OK(
      stipple_views_read_points(views_, 2, read_positions.data(), read_colours.data()));
  EXPECT_EQ(read_positions, positions);
  EXPECT_EQ(read_colours, colours);
  EXPECT_EQ(stipple_views_read_points(views_, 1, read_positions.data(), nullptr),
            STIPPLE_ERROR_BUFFER_TOO_SMALL);
  // A caller that was built before points had times.
  points.struct_size = offsetof(StippleViewPoints, times);
  points.times = reinterpret_cast<const double*>(1);
  STIPPLE_ASSERT_OK(stipple_views_set_points(views_, &points));
  points.struct_size = sizeof(points);
  const std::vector<double> times = {0.5, std::numeric_limits<double>::quiet_NaN()};
  points.times = times.data();
  STIPPLE_ASSERT_OK(stipple_views_set_points(views_, &points));
  const std::vector<double> endless = {std::numeric_limits<double>::infinity(), 0};
  points.times = endless.data();
  EXPECT_EQ(stipple_views_set_points(views_, &points), STIPPLE_ERROR_INVALID_ARGUMENT);
  points.times = nullptr;
  points.count = UINT64_MAX;
  EXPECT_NE(stipple_views_set_points(views_, &points), STIPPLE_OK);
}

/// A folder with one distorted picture of 8 x 6 pixels, whose value is 0.5, and its camera.
class DatasetFolder : public ViewsTest {
 protected:
  void SetUp() override {
    ViewsTest::SetUp();
    std::string pattern =
        (std::filesystem::temp_directory_path() / "stipple_views_XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    const std::vector<float> pixels(8 * 6 * 3, 128.0f / 255.0f);
    StippleImage* image = nullptr;
    STIPPLE_ASSERT_OK(
        stipple_image_create(context_, 8, 6, 3, STIPPLE_TRANSFER_SRGB, pixels.data(), &image));
    STIPPLE_ASSERT_OK(stipple_image_save(image, (folder_ / "a.png").c_str(), 0));
    stipple_image_free(image);
    std::ofstream(folder_ / "transforms.json")
        << "{\"camera_model\": \"OPENCV\", \"fl_x\": 8, \"w\": 8, \"h\": 6, \"k1\": -0.1, "
           "\"frames\": [{\"file_path\": \"a.png\", \"transform_matrix\": "
           "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}";
  }
  void TearDown() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
    ViewsTest::TearDown();
  }
  std::filesystem::path folder_;
};

TEST_F(DatasetFolder, OpensWithItsPictures) {
  StippleViews* views = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_open(context_, folder_.c_str(), nullptr, &views));
  auto info = sized<StippleViewsInfo>();
  STIPPLE_ASSERT_OK(stipple_views_info(views, &info));
  EXPECT_EQ(info.view_count, 1u);
  EXPECT_EQ(info.has_images, 1u);
  auto view = sized<StippleViewInfo>();
  STIPPLE_ASSERT_OK(stipple_views_view_info(views, 0, &view));
  EXPECT_STREQ(view.name, "a.png");
  EXPECT_EQ(view.image_path, (folder_ / "a.png").string());
  EXPECT_STREQ(view.camera_model, "OPENCV");
  EXPECT_EQ(view.is_distorted, 1u);
  EXPECT_EQ(view.source_width, 8u);
  auto camera = sized<StippleCamera>();
  STIPPLE_ASSERT_OK(stipple_views_camera(views, 0, &camera));
  std::vector<float> rgba(size_t{camera.width} * camera.height * 4);
  auto buffers = sized<StippleViewBuffers>();
  buffers.capacity = uint64_t{camera.width} * camera.height;
  buffers.rgba = rgba.data();
  STIPPLE_ASSERT_OK(stipple_views_read(views, 0, &buffers));
  const size_t middle = (size_t{camera.height} / 2 * camera.width + camera.width / 2) * 4;
  EXPECT_EQ(rgba[middle], 128.0f / 255.0f);
  EXPECT_EQ(rgba[middle + 3], 1.0f);
  // Views of files do not grow.
  const StippleViewImage given = picture(rgba_);
  EXPECT_EQ(stipple_views_add(views, &camera_, &given, nullptr), STIPPLE_ERROR_INVALID_ARGUMENT);
  stipple_views_free(views);
}

TEST_F(DatasetFolder, ObeysItsOptionsAndTheMemoryLimit) {
  StippleViewsOpenOptions options;
  stipple_views_open_options_init(&options);
  EXPECT_EQ(options.downscale, 1u);
  options.downscale = 2;
  StippleViews* views = nullptr;
  STIPPLE_ASSERT_OK(stipple_views_open(context_, folder_.c_str(), &options, &views));
  auto camera = sized<StippleCamera>();
  STIPPLE_ASSERT_OK(stipple_views_camera(views, 0, &camera));
  EXPECT_NEAR(camera.width, 4, 1);
  stipple_views_free(views);
  options.downscale = 65;
  EXPECT_EQ(stipple_views_open(context_, folder_.c_str(), &options, &views),
            STIPPLE_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(stipple_last_error_message(), "downscale is 65; 1 to 64 is allowed");

  StippleContextOptions small;
  stipple_context_options_init(&small);
  small.memory_limit_bytes = 1000;
  StippleContext* context = nullptr;
  STIPPLE_ASSERT_OK(stipple_context_create(&small, &context));
  EXPECT_EQ(stipple_views_open(context, folder_.c_str(), nullptr, &views),
            STIPPLE_ERROR_MEMORY_LIMIT);
  stipple_context_free(context);
}

TEST_F(DatasetFolder, OpensSeriesOfFramesAndTellsTheirTimes) {
  std::string frames;
  for (const char* camera : {"cam0", "cam1"}) {
    std::filesystem::create_directories(folder_ / camera);
    for (const char* frame : {"7", "8", "9"}) {
      std::filesystem::copy_file(folder_ / "a.png",
                                 folder_ / camera / (std::string(frame) + ".png"));
    }
    frames += (frames.empty() ? "" : ",") + std::string("{\"file_path\": \"") + camera +
              "/7.png\", \"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
  }
  std::ofstream(folder_ / "transforms.json")
      << "{\"camera_angle_x\": 1, \"frames\": [" << frames << "]}";
  StippleViewsOpenOptions options;
  stipple_views_open_options_init(&options);
  EXPECT_EQ(options.with_frames, 0u);
  EXPECT_EQ(options.last_frame, UINT64_MAX);
  EXPECT_EQ(options.frame_step, 1u);
  const auto infoOf = [&](const StippleViewsOpenOptions& given) {
    auto info = sized<StippleViewsInfo>();
    StippleViews* views = nullptr;
    EXPECT_EQ(stipple_views_open(context_, folder_.c_str(), &given, &views), STIPPLE_OK)
        << stipple_last_error_message();
    if (views != nullptr) {
      EXPECT_EQ(stipple_views_info(views, &info), STIPPLE_OK);
    }
    stipple_views_free(views);
    return info;
  };
  EXPECT_EQ(infoOf(options).view_count, 2u);
  options.with_frames = 1;
  options.frame_rate = 10;
  options.frame_step = 2;
  options.held_out_cameras_utf8 = "cam1";
  const StippleViewsInfo info = infoOf(options);
  EXPECT_EQ(info.view_count, 4u);
  EXPECT_EQ(info.found_count, 6u);
  EXPECT_EQ(info.camera_count, 2u);
  EXPECT_EQ(info.frame_count, 2u);
  EXPECT_EQ(info.time_begin, 0.7);
  EXPECT_EQ(info.time_end, 0.9);
  // Who was compiled before there were frames asks for none, whatever lies behind his options.
  options.struct_size = offsetof(StippleViewsOpenOptions, with_frames);
  EXPECT_EQ(infoOf(options).view_count, 2u);
}

TEST_F(DatasetFolder, CamerasAloneHaveNoPictures) {
  StippleViews* views = nullptr;
  EXPECT_EQ(stipple_views_load(context_, folder_.c_str(), &views), STIPPLE_ERROR_UNSUPPORTED);
  std::ofstream(folder_ / "transforms.json")
      << "{\"fl_x\": 8, \"w\": 8, \"h\": 6, \"frames\": [{\"file_path\": \"none.png\", "
         "\"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}";
  EXPECT_EQ(stipple_views_open(context_, folder_.c_str(), nullptr, &views), STIPPLE_ERROR_IO);
  STIPPLE_ASSERT_OK(stipple_views_load(context_, folder_.c_str(), &views));
  auto info = sized<StippleViewsInfo>();
  STIPPLE_ASSERT_OK(stipple_views_info(views, &info));
  EXPECT_EQ(info.has_images, 0u);
  auto buffers = sized<StippleViewBuffers>();
  EXPECT_EQ(stipple_views_read(views, 0, &buffers), STIPPLE_ERROR_UNSUPPORTED);
  stipple_views_free(views);
}

}  // namespace
}  // namespace stipple::test
