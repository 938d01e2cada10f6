#include "data/views/view_resample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

Camera lensCamera(uint32_t width, uint32_t height, double focal) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal;
  camera.fy = 1.02 * focal;
  camera.cx = 0.48 * width;
  camera.cy = 0.53 * height;
  return camera;
}

/// Channels: x and y of the pixel's own centre, and 1.
Image coordinates(uint32_t width, uint32_t height) {
  Image image;
  image.width = width;
  image.height = height;
  image.channels = 3;
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      image.pixels.insert(image.pixels.end(),
                          {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, 1.0f});
    }
  }
  return image;
}

struct NamedLens {
  const char* name;
  Lens lens;
};

std::vector<NamedLens> lenses() {
  std::vector<NamedLens> all;
  Lens lens;
  lens.radial = {-0.12, 0.03};
  all.push_back({"barrel", lens});
  lens.radial = {0.15, 0.02};
  all.push_back({"pincushion", lens});
  lens.radial = {-0.28, 0.09};
  lens.tangential = {1e-3, -2e-3};
  all.push_back({"opencv", lens});
  lens.divisor = {0.02, 0.01};
  all.push_back({"rational", lens});
  lens = {};
  lens.fisheye = true;
  lens.radial = {0.03, -0.01, 0.002, -0.0005};
  all.push_back({"fisheye", lens});
  lens.tangential = {1e-3, 2e-3};
  lens.prism = {1e-3, 0, -2e-3, 0};
  all.push_back({"thin prism fisheye", lens});
  lens = {};
  lens.field_of_view = 0.9;
  all.push_back({"fov", lens});
  return all;
}

TEST(Undistortion, PointsLandWhereTheFullModelSeesThem) {
  std::mt19937 random(5);
  for (const NamedLens& given : lenses()) {
    SCOPED_TRACE(given.name);
    const Camera seen_by = lensCamera(160, 120, given.lens.fisheye ? 60 : 130);
    const Camera target = undistortedCamera(seen_by, given.lens);
    validate(target);
    std::vector<float> covered;
    const Image image = undistort(coordinates(160, 120), seen_by, given.lens, target,
                                  PixelLookup::kBilinear, &covered);
    ASSERT_EQ(image.width, target.width);
    size_t seen = 0;
    std::uniform_int_distribution<uint32_t> column(0, target.width - 1), row(0, target.height - 1);
    for (int i = 0; i < 500; ++i) {
      const uint32_t x = column(random), y = row(random);
      // A point of space that the pinhole camera shows in the middle of this pixel.
      const double z = 0.5 + 0.01 * i;
      const Vec3d point((x + 0.5 - target.cx) / target.fx * z,
                        (y + 0.5 - target.cy) / target.fy * z, z);
      const Vec2d at = distort(given.lens, Vec2d(point.x() / point.z(), point.y() / point.z()));
      const double u = seen_by.fx * at.x() + seen_by.cx, v = seen_by.fy * at.y() + seen_by.cy;
      const float* pixel = &image.pixels[(y * target.width + x) * 3];
      // Within half a pixel of the border the outermost pixel stands for all.
      if (u < 0.5 || v < 0.5 || u > 159.5 || v > 119.5) continue;
      if (covered[y * target.width + x] == 0) continue;
      ++seen;
      ASSERT_EQ(pixel[2], 1.0f);
      ASSERT_NEAR(pixel[0], u, 0.01) << x << " " << y;
      ASSERT_NEAR(pixel[1], v, 0.01) << x << " " << y;
    }
    EXPECT_GT(seen, 400u);
  }
}

TEST(Undistortion, KeepsAboutAsManyPixelsAndReachesTheSides) {
  for (const NamedLens& given : lenses()) {
    SCOPED_TRACE(given.name);
    const Camera seen_by = lensCamera(160, 120, given.lens.fisheye ? 60 : 130);
    const Camera target = undistortedCamera(seen_by, given.lens);
    EXPECT_NEAR(double(target.width) * target.height, 160 * 120, 160);
    EXPECT_NEAR(target.fx / target.fy, seen_by.fx / seen_by.fy, 0.02);
    // The middle of the left side is the left side of the lens's picture, or 60 degrees away.
    const double left = -target.cx / target.fx;
    const Vec2d side = distort(given.lens, {left, 0});
    const bool is_limited = std::abs(left + std::sqrt(3.0)) < 1e-9;
    EXPECT_TRUE(is_limited || std::abs(seen_by.fx * side.x() + seen_by.cx) < 1e-6) << left;
  }
}

TEST(Undistortion, CountsNothingOutsideOfTheLensPicture) {
  Lens lens;
  lens.radial = {0.3};
  const Camera seen_by = lensCamera(100, 100, 80);
  const Camera target = undistortedCamera(seen_by, lens);
  std::vector<float> covered;
  const Image image =
      undistort(coordinates(100, 100), seen_by, lens, target, PixelLookup::kBilinear, &covered);
  // A pincushion's corners lie beyond the picture, its sides inside.
  EXPECT_EQ(covered.front(), 0.0f);
  EXPECT_EQ(image.pixels[2], 0.0f);
  EXPECT_EQ(covered[target.height / 2 * target.width], 1.0f);
  EXPECT_EQ(covered[target.width / 2], 1.0f);
}

TEST(Undistortion, DoesNotShowWhatAModelFoldsOver) {
  Lens lens;
  lens.radial = {-0.35};
  // The model turns round at r = 0.976, well inside of this wide picture.
  const Camera seen_by = lensCamera(200, 200, 100);
  const Camera target = undistortedCamera(seen_by, lens);
  EXPECT_LT(target.cx / target.fx, 0.977);
  std::vector<float> covered;
  undistort(coordinates(200, 200), seen_by, lens, target, PixelLookup::kBilinear, &covered);
  for (uint32_t y = 0; y < target.height; ++y) {
    for (uint32_t x = 0; x < target.width; ++x) {
      const double radius =
          std::hypot((x + 0.5 - target.cx) / target.fx, (y + 0.5 - target.cy) / target.fy);
      if (radius > 0.977) {
        ASSERT_EQ(covered[y * target.width + x], 0.0f);
      }
    }
  }
}

TEST(Undistortion, RefusesALensThatSeesNothingAtItsCentre) {
  Camera seen_by = lensCamera(100, 100, 80);
  seen_by.cx = -50;
  Lens lens;
  lens.radial = {0.1};
  EXPECT_THROW(undistortedCamera(seen_by, lens), Error);
}

TEST(AreaAverage, OfWholeBoxesIsTheirMean) {
  Image image = coordinates(6, 4);
  const Image half = areaAverage(image, 3, 2);
  EXPECT_EQ(half.pixels,
            (std::vector<float>{1, 1, 1, 3, 1, 1, 5, 1, 1, 1, 3, 1, 3, 3, 1, 5, 3, 1}));
  EXPECT_EQ(areaAverage(image, 6, 4).pixels, image.pixels);
}

TEST(AreaAverage, CountsPartsOfPixelsByTheirArea) {
  Image image;
  image.width = 5;
  image.height = 1;
  image.channels = 1;
  image.pixels = {1, 2, 4, 8, 16};
  // Boxes of 5/3: 1 + 2/3 of 2, and so on.
  const Image third = areaAverage(image, 3, 1);
  // One rounding to float32 of numbers below 16.
  EXPECT_NEAR(third.pixels[0], (1 + 2 * 2.0 / 3) * 3 / 5, 1e-6);
  EXPECT_NEAR(third.pixels[1], (2.0 / 3 + 4 + 8.0 / 3) * 3 / 5, 1e-6);
  EXPECT_NEAR(third.pixels[2], (2.0 / 3 * 8 + 16) * 3 / 5, 2e-6);
}

TEST(AreaAverage, KeepsTheSumAndDoesNotDependOnThreads) {
  std::mt19937 random(1);
  Image image = coordinates(97, 61);
  for (float& value : image.pixels) value = std::uniform_real_distribution<float>(0, 1)(random);
  Image one, many;
  withThreads(1, [&] { one = areaAverage(image, 31, 17); });
  withThreads(4, [&] { many = areaAverage(image, 31, 17); });
  EXPECT_EQ(one.pixels, many.pixels);
  double before = 0, after = 0;
  for (const float value : image.pixels) before += double{value};
  for (const float value : one.pixels) after += double{value};
  EXPECT_NEAR(before / image.pixelCount(), after / one.pixelCount(), 1e-7 * before);
}

TEST(AreaAverage, MovesTheCameraWithThePicture) {
  const Camera camera = lensCamera(5, 4, 7);
  const Camera small = resized(camera, 3, 1);
  EXPECT_DOUBLE_EQ(small.fx, 7 * 0.6);
  EXPECT_DOUBLE_EQ(small.cx, 0.48 * 3);
  EXPECT_DOUBLE_EQ(small.cy, 0.53);
  EXPECT_EQ(small.height, 1u);
}

TEST(NearestPixels, TakesThoseAtTheNewCentres) {
  const Image image = coordinates(6, 3);
  const Image small = nearestPixels(image, 2, 1);
  EXPECT_EQ(small.pixels, (std::vector<float>{1.5, 1.5, 1, 4.5, 1.5, 1}));
  EXPECT_EQ(nearestPixels(small, 6, 3).pixels[3], 1.5f);
}

}  // namespace
}  // namespace stipple
