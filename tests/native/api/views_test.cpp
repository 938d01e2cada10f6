#include <gtest/gtest.h>

#include <cmath>
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
  StippleViewPicture picture(const float* rgba, uint32_t transfer = STIPPLE_TRANSFER_SRGB) const {
    auto made = sized<StippleViewPicture>();
    made.transfer = transfer;
    made.rgba = rgba;
    return made;
  }

  StippleViews* views_ = nullptr;
  StippleCamera camera_ = frontCamera();
  const float rgba_[8] = {0.25f, 0.125f, 0.0f, 0.5f, 1.0f, 0.5f, 0.25f, 1.0f};
};

TEST_F(ViewsTest, GivesBackThePictureThatWasAdded) {
  const float depth[2] = {2.5f, 1e10f}, weights[2] = {0.0f, 1.0f};
  StippleViewPicture given = picture(rgba_);
  given.depth = depth;
  given.weights = weights;
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, "left"));
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));

  auto info = sized<StippleViewsInfo>();
  STIPPLE_ASSERT_OK(stipple_views_info(views_, &info));
  EXPECT_EQ(info.view_count, 2u);
  EXPECT_EQ(info.has_pictures, 1u);
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
  EXPECT_EQ(rgba, std::vector<float>(rgba_, rgba_ + 8));
  EXPECT_EQ(depths, (std::vector<float>{2.5f, 0.0f}));
  EXPECT_EQ(masks, (std::vector<float>{0.0f, 1.0f}));
  EXPECT_EQ(normals, std::vector<float>(6, 0.0f));
}

TEST_F(ViewsTest, BringsLinearPicturesIntoTheViewsColourSpace) {
  const StippleViewPicture given = picture(rgba_, STIPPLE_TRANSFER_LINEAR);
  STIPPLE_ASSERT_OK(stipple_views_add(views_, &camera_, &given, nullptr));
  std::vector<float> rgba(8);
  auto buffers = sized<StippleViewBuffers>();
  buffers.capacity = 2;
  buffers.rgba = rgba.data();
  STIPPLE_ASSERT_OK(stipple_views_read(views_, 0, &buffers));
  const auto encoded = [](double linear) { return 1.055 * std::pow(linear, 1 / 2.4) - 0.055; };
  // The curve belongs to the straight colour; pow in float32 leaves 1e-6.
  EXPECT_NEAR(rgba[0], 0.5 * encoded(0.5), 1e-6);
  EXPECT_NEAR(rgba[1], 0.5 * encoded(0.25), 1e-6);
  EXPECT_NEAR(rgba[5], encoded(0.5), 1e-6);
  EXPECT_EQ(rgba[3], 0.5f);
}

TEST_F(ViewsTest, RefusesWhatCannotBeAPictureAndKeepsTheRest) {
  float bad[8];
  std::copy(rgba_, rgba_ + 8, bad);
  bad[5] = std::numeric_limits<float>::quiet_NaN();
  StippleViewPicture given = picture(bad);
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
  const StippleViewPicture given = picture(rgba_);
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
  const StippleViewPicture given = picture(rgba_);
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
  points.count = UINT64_MAX;
  EXPECT_NE(stipple_views_set_points(views_, &points), STIPPLE_OK);
}

}  // namespace
}  // namespace stipple::test
