#include "io/image_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "math/colour.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class ImageFile : public ScratchFolder {};

Image picture(uint32_t width, uint32_t height, uint32_t channels, Transfer transfer) {
  Image image;
  image.width = width;
  image.height = height;
  image.channels = channels;
  image.transfer = transfer;
  image.pixels.resize(image.pixelCount() * channels);
  return image;
}

TEST_F(ImageFile, KeepsFloatsExactlyInExr) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0.0f, 10.0f);
  for (const uint32_t channels : {1u, 3u, 4u}) {
    Image image = picture(37, 21, channels, Transfer::kLinear);
    for (float& value : image.pixels) value = normal(random);
    writeImageFile(image, path("a.exr"));
    const Image seen = readImageFile(path("a.exr"));
    EXPECT_EQ(seen.width, 37u);
    EXPECT_EQ(seen.height, 21u);
    ASSERT_EQ(seen.channels, channels);
    EXPECT_EQ(seen.transfer, Transfer::kLinear);
    EXPECT_EQ(seen.pixels, image.pixels);
  }
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(ImageFile, KeepsEveryByteOfAPng) {
  // All values of colour and alpha; where alpha is 0 the premultiplied colour is 0 by definition.
  Image image = picture(256, 256, 4, Transfer::kSrgb);
  for (size_t alpha = 0; alpha < 256; ++alpha) {
    for (size_t colour = 0; colour < 256; ++colour) {
      float* pixel = &image.pixels[(alpha * 256 + colour) * 4];
      pixel[3] = static_cast<float>(alpha) / 255.0f;
      for (size_t c = 0; c < 3; ++c) {
        pixel[c] = static_cast<float>((colour + 85 * c) % 256) / 255.0f * pixel[3];
      }
    }
  }
  writeImageFile(image, path("a.png"));
  const Image seen = readImageFile(path("a.png"));
  ASSERT_EQ(seen.channels, 4u);
  EXPECT_EQ(seen.transfer, Transfer::kSrgb);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    // 1e-6: float32 rounding of the division and multiplication by alpha; a byte is 4e-3.
    ASSERT_NEAR(seen.pixels[i], image.pixels[i], 1e-6f) << i;
  }
  writeImageFile(seen, path("b.png"));
  EXPECT_EQ(readImageFile(path("b.png")).pixels, seen.pixels);
}

TEST_F(ImageFile, ReadsRowsFromTheTopAndColoursInOrder) {
  Image image = picture(2, 2, 3, Transfer::kSrgb);
  image.pixels = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
  for (const char* name : {"a.png", "a.exr"}) {
    writeImageFile(image, path(name), true);
    EXPECT_EQ(readImageFile(path(name)).pixels, image.pixels) << name;
  }
}

TEST_F(ImageFile, ConvertsTheStraightColourBetweenTransfers) {
  Image linear = picture(1, 1, 4, Transfer::kLinear);
  linear.pixels = {0.1f, 0.25f, 0.5f, 0.5f};
  writeImageFile(linear, path("a.png"));
  const Image png = readImageFile(path("a.png"));
  // 128/255 is the byte for an alpha of 0.5; half a step of 8 bits, 1/510, in colour and alpha.
  EXPECT_NEAR(png.pixels[3], 0.5f, 1.0f / 510.0f + 1e-6f);
  for (size_t c = 0; c < 3; ++c) {
    const float straight = png.pixels[c] / png.pixels[3];
    EXPECT_NEAR(straight, linearToSrgb(linear.pixels[c] / 0.5f), 1.0f / 510.0f + 1e-6f);
  }
  Image display = picture(1, 1, 4, Transfer::kSrgb);
  display.pixels = {0.1f, 0.25f, 0.5f, 0.5f};
  writeImageFile(display, path("a.exr"));
  const Image exr = readImageFile(path("a.exr"));
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(exr.pixels[c], srgbToLinear(display.pixels[c] / 0.5f) * 0.5f);
  }
  writeImageFile(display, path("b.exr"), true);
  EXPECT_EQ(readImageFile(path("b.exr")).pixels, display.pixels);
}

TEST_F(ImageFile, ClampsWhatAPngCannotHold) {
  Image image = picture(4, 1, 1, Transfer::kSrgb);
  image.pixels = {-1.0f, 2.0f, std::nanf(""), HUGE_VALF};
  writeImageFile(image, path("a.png"));
  EXPECT_EQ(readImageFile(path("a.png")).pixels, (std::vector<float>{0, 1, 0, 1}));
}

TEST_F(ImageFile, ReadsPortablePixmapsAsRgb) {
  // 8-bit PPM, written by hand: red, then grey 128.
  const std::string bytes =
      std::string("P6\n2 1\n255\n") + "\xff" + std::string(2, '\0') + "\x80\x80\x80";
  const Image image = readImageFile(store("a.ppm", bytes));
  ASSERT_EQ(image.channels, 3u);
  EXPECT_EQ(image.transfer, Transfer::kSrgb);
  EXPECT_EQ(image.pixels[0], 1.0f);
  EXPECT_EQ(image.pixels[1], 0.0f);
  EXPECT_NEAR(image.pixels[4], 128.0f / 255.0f, 1e-6f);
}

TEST_F(ImageFile, RefusesWhatIsNotAPicture) {
  expectError(ErrorCode::kIo, {"missing.png", "No such file"},
              [&] { readImageFile(path("missing.png")); });
  expectError(ErrorCode::kIo, {"folder"}, [&] { readImageFile(folder_.string()); });
  expectError(ErrorCode::kFormat, {"a.png"}, [&] { readImageFile(store("a.png", "")); });
  expectError(ErrorCode::kFormat, {"a.png"}, [&] { readImageFile(store("a.png", "no picture")); });
  expectError(ErrorCode::kFormat, {"a.exr"}, [&] { readImageFile(store("a.exr", "no picture")); });
  Image image = picture(64, 64, 4, Transfer::kSrgb);
  writeImageFile(image, path("whole.png"));
  const std::string bytes = load(path("whole.png"));
  expectError(ErrorCode::kFormat, {"cut.png"},
              [&] { readImageFile(store("cut.png", bytes.substr(0, bytes.size() / 2))); });
}

TEST_F(ImageFile, RefusesWhatCannotBeWritten) {
  const Image image = picture(2, 2, 3, Transfer::kSrgb);
  expectError(ErrorCode::kUnsupported, {"'.jpg'", ".png and .exr"},
              [&] { writeImageFile(image, path("a.jpg")); });
  expectError(ErrorCode::kIo, {"missing/a.png", "No such file"},
              [&] { writeImageFile(image, path("missing/a.png")); });
  Image bad = image;
  bad.channels = 2;
  expectError(ErrorCode::kInvalidArgument, {"2 channels"},
              [&] { writeImageFile(bad, path("a.png")); });
  bad = image;
  bad.pixels.pop_back();
  expectError(ErrorCode::kInvalidArgument, {"11 values", "12"},
              [&] { writeImageFile(bad, path("a.png")); });
  bad = picture(0, 2, 3, Transfer::kSrgb);
  expectError(ErrorCode::kInvalidArgument, {"0 x 2"}, [&] { writeImageFile(bad, path("a.png")); });
  EXPECT_EQ(fileCount(), 0u);
}

}  // namespace
}  // namespace stipple
