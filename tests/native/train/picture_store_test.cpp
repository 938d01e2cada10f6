// Pictures of fewer pixels, which the first steps of a fit look at.
#include <gtest/gtest.h>

#include <algorithm>

#include "train/loop/picture_store.h"

namespace stipple {
namespace {

TargetPicture pictureOf(uint32_t width, uint32_t height) {
  TargetPicture picture;
  picture.width = width;
  picture.height = height;
  for (uint32_t i = 0; i < width * height; ++i) {
    picture.colour.insert(picture.colour.end(), {static_cast<float>(i), 1.0f, 0.5f});
  }
  return picture;
}

Camera cameraOf(uint32_t width, uint32_t height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = 90;
  camera.fy = 80;
  camera.cx = 2.6;
  camera.cy = 1.8;
  return camera;
}

TEST(ReducePicture, TakesMeansOfBlocksAndCutsOffWhatIsLeftOver) {
  TargetPicture picture = pictureOf(5, 3);
  Camera camera = cameraOf(5, 3);
  reducePicture(2, picture, camera);
  EXPECT_EQ(picture.width, 2u);
  EXPECT_EQ(picture.height, 1u);
  // Pixels 0, 1, 5, 6 and 2, 3, 7, 8.
  EXPECT_EQ(picture.colour, (std::vector<float>{3, 1, 0.5f, 5, 1, 0.5f}));
  EXPECT_TRUE(picture.alpha.empty());
  EXPECT_TRUE(picture.weights.empty());
}

TEST(ReducePicture, LooksAtTheSamePlacesWithTheCamera) {
  TargetPicture picture = pictureOf(8, 8);
  Camera camera = cameraOf(8, 8);
  const double ray_x = (6.0 - camera.cx) / camera.fx, ray_y = (4.0 - camera.cy) / camera.fy;
  reducePicture(4, picture, camera);
  EXPECT_EQ(camera.width, 2u);
  EXPECT_EQ(camera.height, 2u);
  // What was at (6, 4), in pixels from the corner, is at a quarter of that.
  EXPECT_NEAR(camera.cx + ray_x * camera.fx, 1.5, 1e-12);
  EXPECT_NEAR(camera.cy + ray_y * camera.fy, 1.0, 1e-12);
}

TEST(ReducePicture, LeavesOutWhatMasksLeaveOut) {
  TargetPicture picture = pictureOf(4, 2);
  picture.alpha = {1, 0, 1, 1, 1, 0, 0, 0};
  picture.weights = {1, 0, 0, 0, 1, 0, 0, 0};
  Camera camera = cameraOf(4, 2);
  reducePicture(2, picture, camera);
  // Pixels 0 and 4 count on the left; on the right none does, and all four have a say.
  EXPECT_EQ(picture.colour, (std::vector<float>{2, 1, 0.5f, 4.5f, 1, 0.5f}));
  EXPECT_EQ(picture.alpha, (std::vector<float>{1, 0.5f}));
  EXPECT_EQ(picture.weights, (std::vector<float>{0.5f, 0}));
}

}  // namespace
}  // namespace stipple
