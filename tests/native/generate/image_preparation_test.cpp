// What bytes come out for real pictures is compared with another program's by the golden file
// deg_pipeline_a; here are the rules one by one.
#include "generate/image_preparation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "generate/byte_resize.h"

namespace stipple {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

using Pixel = std::array<uint8_t, 4>;

/// RGBA, each pixel by its column and row.
ByteImage picture(uint32_t width, uint32_t height,
                  const std::function<Pixel(uint32_t, uint32_t)>& pixel) {
  ByteImage image = {width, height, 4, {}};
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const Pixel values = pixel(x, y);
      image.pixels.insert(image.pixels.end(), values.begin(), values.end());
    }
  }
  return image;
}

bool isInside(uint32_t x, uint32_t y, uint32_t begin, uint32_t end) {
  return x >= begin && x < end && y >= begin && y < end;
}

/// Opaque white from `begin` to `end` in both directions; transparent red around it.
ByteImage square(uint32_t size, uint32_t begin, uint32_t end) {
  return picture(size, size, [&](uint32_t x, uint32_t y) {
    return isInside(x, y, begin, end) ? Pixel{255, 255, 255, 255} : Pixel{255, 0, 0, 0};
  });
}

ByteImage noise(uint32_t width, uint32_t height, uint32_t channels) {
  ByteImage image = {width, height, channels, {}};
  for (size_t i = 0; i < image.pixelCount() * channels; ++i) {
    image.pixels.push_back(static_cast<uint8_t>(keyedBits(3, RandomUse::kNetworkStart, i)));
  }
  return image;
}

PreparationOptions smallCanvas(uint32_t erode_radius = 0) {
  PreparationOptions options;
  options.canvas_size = 64;
  options.erode_radius = erode_radius;
  return options;
}

std::string messageOf(const ByteImage& image, const ByteImage* mask = nullptr,
                      const PreparationOptions& options = smallCanvas(1)) {
  try {
    prepareImage(image, mask, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "";
}

TEST(ByteResize, KeepsPicturesOfTheRightSizeAndThoseOfOneColour) {
  const ByteImage image = noise(9, 7, 4);
  EXPECT_EQ(resizeBytes(image, 9, 7).pixels, image.pixels);
  const ByteImage grey = {5, 3, 1, std::vector<uint8_t>(15, 201)};
  EXPECT_THAT(resizeBytes(grey, 16, 2).pixels, Each(201));
}

TEST(ByteResize, HalvesAStepByTheFiltersWeights) {
  // Weights L((x - c + 0.5) / 2) over their sum, centres c = 1, 3, 5, 7, in double: -4.11, 12.59,
  // 242.41 and 259.11.
  const ByteImage row = {8, 1, 1, {0, 0, 0, 0, 255, 255, 255, 255}};
  EXPECT_THAT(resizeBytes(row, 4, 1).pixels, ElementsAre(0, 13, 242, 255));
}

TEST(ByteResize, LetsNoColourOfTransparentPixelsThrough) {
  const ByteImage image = square(40, 0, 20);
  const ByteImage half = resizeBytes(image, 20, 20);
  for (size_t i = 0; i < half.pixels.size(); i += 4) {
    if (half.pixels[i + 3] == 0) continue;
    // White alone: green and blue are there wherever red is.
    EXPECT_EQ(half.pixels[i], half.pixels[i + 1]);
    EXPECT_EQ(half.pixels[i], half.pixels[i + 2]);
  }
}

TEST(ByteResize, GivesTheSameBytesForAnyNumberOfThreads) {
  const ByteImage image = noise(133, 71, 4);
  ByteImage one;
  withThreads(1, [&] { one = resizeBytes(image, 50, 90); });
  withThreads(3, [&] { EXPECT_EQ(resizeBytes(image, 50, 90).pixels, one.pixels); });
}

TEST(ImagePreparation, PutsTheObjectInTheMiddleWithAMargin) {
  const PreparedImage prepared = prepareImage(square(64, 10, 31), nullptr, smallCanvas());
  EXPECT_THAT(prepared.box, ElementsAre(10, 10, 30, 30));
  // Centre 20, half 10 * 1.2.
  EXPECT_THAT(prepared.crop, ElementsAre(8, 8, 32, 32));
  EXPECT_EQ(prepared.size, 64u);
  ASSERT_EQ(prepared.rgb.size(), 64u * 64 * 3);
  EXPECT_EQ(prepared.rgb[0], 0);
  EXPECT_EQ(prepared.rgb[(32 * 64 + 32) * 3], 255);
}

TEST(ImagePreparation, RoundsWhatLiesOutsideTowardZero) {
  // Centre 10, half 12: begins at -2. With one pixel more, centre 10.5, half 12.6: -2.1.
  EXPECT_THAT(prepareImage(square(64, 0, 21), nullptr, smallCanvas()).crop,
              ElementsAre(-2, -2, 22, 22));
  PreparationSteps steps;
  const PreparedImage prepared = prepareImage(square(64, 0, 22), nullptr, smallCanvas(), &steps);
  EXPECT_THAT(prepared.crop, ElementsAre(-2, -2, 23, 23));
  EXPECT_EQ(steps.cropped.width, 25u);
  // Transparent black outside, not the image's red.
  EXPECT_EQ(steps.cropped.pixels[0], 0);
  EXPECT_EQ(steps.cropped.pixels[4 * (2 * 25 + 2)], 255);
}

TEST(ImagePreparation, ShrinksTheMaskButNotAtTheBorderOfTheImage) {
  EXPECT_THAT(prepareImage(square(64, 10, 31), nullptr, smallCanvas(2)).box,
              ElementsAre(12, 12, 28, 28));
  EXPECT_THAT(prepareImage(square(64, 0, 31), nullptr, smallCanvas(2)).box,
              ElementsAre(0, 0, 28, 28));
}

TEST(ImagePreparation, TakesTheObjectFromAMaskOfAnotherSize) {
  const ByteImage photo = noise(80, 64, 3);
  // White in the left half.
  ByteImage mask = {20, 16, 1, {}};
  for (uint32_t i = 0; i < 20 * 16; ++i) mask.pixels.push_back(i % 20 < 10 ? 255 : 0);
  PreparationSteps steps;
  const PreparedImage prepared = prepareImage(photo, &mask, smallCanvas(), &steps);
  EXPECT_EQ(steps.resized.width, 80u);
  EXPECT_EQ(prepared.box[0], 0);
  // The edge at 40, and the ringing of three lobes of four pixels beside it.
  EXPECT_NEAR(prepared.box[2], 40, 12);
  EXPECT_EQ(prepared.box[3], 63);
  // The colours are the photograph's.
  EXPECT_EQ(steps.resized.pixels[0], photo.pixels[0]);
}

TEST(ImagePreparation, PrefersTheMaskToTheImagesOwnAlpha) {
  const ByteImage mask = {1, 1, 1, {255}};
  PreparationSteps steps;
  const PreparedImage prepared = prepareImage(square(64, 10, 31), &mask, smallCanvas(), &steps);
  EXPECT_THAT(prepared.box, ElementsAre(0, 0, 63, 63));
  // What the image's alpha hid is there.
  EXPECT_EQ(steps.resized.pixels[0], 255);
  EXPECT_EQ(steps.resized.pixels[1], 0);
}

TEST(ImagePreparation, AsksForAMaskWhereTheImageIsOpaque) {
  for (const uint32_t channels : {1u, 3u}) {
    const std::string message = messageOf(noise(70, 64, channels));
    EXPECT_THAT(message, HasSubstr("opaque everywhere"));
    EXPECT_THAT(message, HasSubstr("or a mask beside it"));
  }
  // Opaque as of the resized image: one pixel of 254 among 16 x 16 that become one.
  const ByteImage image = picture(1024, 1024, [](uint32_t x, uint32_t y) {
    return Pixel{9, 9, 9, static_cast<uint8_t>(x == 8 && y == 8 ? 254 : 255)};
  });
  EXPECT_THAT(messageOf(image), HasSubstr("opaque everywhere"));
}

TEST(ImagePreparation, SaysWhenNothingIsLeft) {
  const ByteImage empty = square(64, 0, 0);
  EXPECT_THAT(messageOf(empty), HasSubstr("Nothing is left of the object"));
  // A line is gone after a pixel on either side, and a single pixel has no square.
  const ByteImage line = picture(64, 64, [](uint32_t, uint32_t y) {
    return Pixel{9, 9, 9, static_cast<uint8_t>(y == 30 ? 255 : 0)};
  });
  EXPECT_THAT(messageOf(line), HasSubstr("shrunk by 1 pixels"));
  EXPECT_THAT(messageOf(square(64, 30, 31), nullptr, smallCanvas(0)),
              HasSubstr("Nothing is left of the object"));
  EXPECT_EQ(messageOf(square(64, 30, 32), nullptr, smallCanvas(0)), "");
}

TEST(ImagePreparation, RefusesHostileInput) {
  ByteImage image = noise(8, 8, 4);
  image.pixels.pop_back();
  EXPECT_THAT(messageOf(image), HasSubstr("has 255 bytes; it needs 256"));
  EXPECT_THAT(messageOf({0, 5, 4, {}}), HasSubstr("has no pixels"));
  EXPECT_THAT(messageOf(noise(8, 8, 2)), HasSubstr("2 channels"));
  EXPECT_THAT(messageOf(noise(9, 1, 4)), HasSubstr("8 times as long as wide"));
  ByteImage mask = noise(8, 8, 3);
  EXPECT_THAT(messageOf(noise(8, 8, 4), &mask), HasSubstr("The mask has 3 channels"));
  PreparationOptions options;
  for (const uint32_t size : {0u, 16u, 100u, 4096u}) {
    options.canvas_size = size;
    EXPECT_THAT(messageOf(noise(8, 8, 4), nullptr, options), HasSubstr("The canvas is"));
  }
  EXPECT_THAT(messageOf(noise(8, 8, 4), nullptr, smallCanvas(65)), HasSubstr("0 to 64"));
}

TEST(ImagePreparation, GivesTheSameBytesForAnyNumberOfThreads) {
  const ByteImage image = noise(133, 71, 4);
  PreparedImage one;
  withThreads(1, [&] { one = prepareImage(image, nullptr, smallCanvas()); });
  withThreads(3, [&] { EXPECT_EQ(prepareImage(image, nullptr, smallCanvas()).rgb, one.rgb); });
}

TEST(ByteImage, GivesBackTheBytesThatAPictureWasReadFrom) {
  // As reading a file makes it: display values, multiplied by alpha.
  Image image = {256, 256, 4, {}, Transfer::kSrgb};
  ByteImage bytes = {256, 256, 4, {}};
  for (uint32_t i = 0; i < 256 * 256; ++i) {
    const auto value = static_cast<uint8_t>(i % 256), alpha = static_cast<uint8_t>(i / 256);
    const float a = static_cast<float>(alpha) / 255.0f;
    for (const uint8_t byte : {value, static_cast<uint8_t>(255 - value), value}) {
      bytes.pixels.push_back(alpha == 0 ? 0 : byte);
      image.pixels.push_back(static_cast<float>(byte) / 255.0f * a);
    }
    bytes.pixels.push_back(alpha);
    image.pixels.push_back(a);
  }
  EXPECT_EQ(toByteImage(image).pixels, bytes.pixels);
}

TEST(ByteImage, MakesDisplayValuesOfLinearLightAndZerosOfWhatIsNoNumber) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Image image = {5, 1, 1, {0.0f, 0.2158605f, 1.0f, 7.0f, nan}, Transfer::kLinear};
  EXPECT_THAT(toByteImage(image).pixels, ElementsAre(0, 128, 255, 255, 0));
}

TEST(ByteImage, MakesAMaskOfAlphaOrElseOfBrightness) {
  const ByteImage cut = {2, 1, 4, {9, 9, 9, 255, 9, 9, 9, 40}};
  EXPECT_THAT(toMask(cut).pixels, ElementsAre(255, 40));
  const ByteImage opaque = {2, 1, 4, {9, 9, 9, 255, 255, 0, 0, 255}};
  EXPECT_THAT(toMask(opaque).pixels, ElementsAre(9, 76));
  const ByteImage grey = {2, 1, 3, {0, 0, 0, 255, 255, 255}};
  EXPECT_THAT(toMask(grey).pixels, ElementsAre(0, 255));
}

}  // namespace
}  // namespace stipple
