#include "shot/surroundings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

/// Looks along +y with +z up.
Camera lookingNorth(CameraModel model, uint32_t width, uint32_t height, double focal) {
  Camera camera;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  camera.world_to_camera << 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  return camera;
}

/// The column and the row of each pixel, as its colour.
std::vector<float> places(uint32_t width, uint32_t height) {
  std::vector<float> pixels;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      pixels.insert(pixels.end(), {static_cast<float>(x), static_cast<float>(y), 1.0f});
    }
  }
  return pixels;
}

TEST(Surroundings, APanoramaOfTheSameSizeSeesThemAsTheyAre) {
  const std::vector<float> pixels = places(16, 8);
  const double focal = 16 / (2 * std::numbers::pi);
  const Camera camera = lookingNorth(CameraModel::kEquirectangular, 16, 8, focal);
  const std::vector<float> seen = surroundingsSeen({pixels.data(), 16, 8}, camera);
  ASSERT_EQ(seen.size(), pixels.size());
  // Angles there and back: a few roundings of single precision.
  for (size_t i = 0; i < seen.size(); ++i) EXPECT_NEAR(seen[i], pixels[i], 2e-5f);
}

TEST(Surroundings, TheMiddleColumnIsNorthAndTheRightSideEast) {
  const std::vector<float> pixels = places(64, 32);
  Camera camera = lookingNorth(CameraModel::kPerspective, 1, 1, 1.0);
  const auto seen = [&] { return surroundingsSeen({pixels.data(), 64, 32}, camera); };
  EXPECT_NEAR(seen()[0], 31.5f, 1e-4f);
  EXPECT_NEAR(seen()[1], 15.5f, 1e-4f);
  camera.world_to_camera << 0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1;  // along +x
  EXPECT_NEAR(seen()[0], 47.5f, 1e-4f);
  EXPECT_NEAR(seen()[1], 15.5f, 1e-4f);
  camera.world_to_camera << 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;  // straight up
  EXPECT_EQ(seen()[1], 0.0f);
}

TEST(Surroundings, ColumnsGoAround) {
  std::vector<float> pixels(8 * 4 * 3, 0.0f);
  for (size_t row = 0; row < 4; ++row) {
    pixels[row * 24] = 1.0f;          // the first column
    pixels[row * 24 + 7 * 3] = 3.0f;  // the last one
  }
  Camera camera = lookingNorth(CameraModel::kPerspective, 1, 1, 1.0);
  camera.world_to_camera << -1, 0, 0, 0, 0, 0, -1, 0, 0, -1, 0, 0, 0, 0, 0, 1;  // along -y
  EXPECT_NEAR(surroundingsSeen({pixels.data(), 8, 4}, camera)[0], 2.0f, 1e-5f);
}

TEST(Surroundings, BeyondAFisheyesViewNothingIsSeen) {
  const std::vector<float> pixels(2 * 1 * 3, 0.5f);
  Camera camera = lookingNorth(CameraModel::kFisheyeEquidistant, 9, 9, 3.0);
  camera.field_of_view = 2.0;
  const std::vector<float> seen = surroundingsSeen({pixels.data(), 2, 1}, camera);
  EXPECT_EQ(seen[0], 0.0f);
  EXPECT_EQ(seen[(4 * 9 + 4) * 3], 0.5f);
}

TEST(Surroundings, ThreadsChangeNothing) {
  const std::vector<float> pixels = places(32, 16);
  const Camera camera = lookingNorth(CameraModel::kPerspective, 97, 61, 40.0);
  const Surroundings around{pixels.data(), 32, 16};
  const std::vector<float> many = surroundingsSeen(around, camera);
  std::vector<float> one;
  withThreads(1, [&] { one = surroundingsSeen(around, camera); });
  EXPECT_EQ(many, one);
}

TEST(Surroundings, APictureWithoutPixelsIsRefused) {
  const float pixel[3] = {};
  EXPECT_THROW(validate(Surroundings{pixel, 0, 1}), Error);
  EXPECT_THROW(validate(Surroundings{pixel, 1, 0}), Error);
  EXPECT_NO_THROW(validate(Surroundings{pixel, 1, 1}));
  EXPECT_NO_THROW(validate(Surroundings{}));
}

}  // namespace
}  // namespace stipple
