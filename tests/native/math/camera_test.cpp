#include "math/camera.h"

#include <gtest/gtest.h>

namespace stipple {
namespace {

Camera wide() {
  Camera camera;
  camera.width = 7;
  camera.height = 5;
  camera.fx = 6.5;
  camera.fy = 6;
  camera.cx = 3.25;
  camera.cy = 2;
  return camera;
}

TEST(ScaledCameras, SeeTheSamePictureWithMorePixels) {
  const Camera camera = wide(), large = enlarged(camera, 3);
  EXPECT_EQ(large.width, 21u);
  EXPECT_EQ(large.height, 15u);
  // The middle of the middle one of the nine that a pixel becomes looks where that pixel did.
  for (const double x : {0.5, 3.5, 6.5}) {
    EXPECT_DOUBLE_EQ((3 * x - large.cx) / large.fx, (x - camera.cx) / camera.fx);
    EXPECT_DOUBLE_EQ((3 * x - large.cy) / large.fy, (x - camera.cy) / camera.fy);
  }
}

TEST(ScaledCameras, GoBackAndCutOffWhatIsLeft) {
  const Camera camera = wide(), back = reduced(enlarged(camera, 4), 4);
  EXPECT_EQ(back.width, camera.width);
  EXPECT_EQ(back.height, camera.height);
  EXPECT_DOUBLE_EQ(back.fx, camera.fx);
  EXPECT_DOUBLE_EQ(back.cy, camera.cy);
  const Camera small = reduced(camera, 2);  // 7 x 5 pixels have 3 x 2 whole blocks.
  EXPECT_EQ(small.width, 3u);
  EXPECT_EQ(small.height, 2u);
  EXPECT_DOUBLE_EQ(small.cx, 1.625);
}

}  // namespace
}  // namespace stipple
