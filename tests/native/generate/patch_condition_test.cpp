#include "generate/patch_condition.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace stipple {
namespace {

/// Red says the column, green the row, blue is 255.
PreparedImage ramps(uint32_t size) {
  PreparedImage image;
  image.size = size;
  for (uint32_t y = 0; y < size; ++y) {
    for (uint32_t x = 0; x < size; ++x) {
      image.rgb.push_back(static_cast<uint8_t>(x));
      image.rgb.push_back(static_cast<uint8_t>(y));
      image.rgb.push_back(255);
    }
  }
  return image;
}

TEST(PatchCondition, HasThePixelsOfEachPatchAndItsPlace) {
  const PatchSizes sizes = {.canvas = 64, .patch = 16};
  const ImageCondition made = patchCondition(ramps(64), sizes);
  ASSERT_EQ(made.rows, 16u);
  ASSERT_EQ(made.structure_width, 16u * 16 * 3);
  ASSERT_EQ(made.structure.size(), made.rows * made.structure_width);
  ASSERT_EQ(made.colour.size(), made.rows * made.colour_width);
  const size_t row = 1 * 4 + 2;  // second row, third column of patches
  for (size_t y = 0; y < 16; ++y) {
    for (size_t x = 0; x < 16; ++x) {
      const float* const pixel = &made.structure[row * made.structure_width + (y * 16 + x) * 3];
      EXPECT_NEAR(pixel[0], (32.0f + static_cast<float>(x)) / 127.5f - 1, 1e-6f);
      EXPECT_NEAR(pixel[1], (16.0f + static_cast<float>(y)) / 127.5f - 1, 1e-6f);
      EXPECT_EQ(pixel[2], 1.0f);
    }
  }
  const float* const place = &made.colour[row * made.colour_width];
  EXPECT_NEAR(place[0], std::sin(M_PI * 2.5 / 4), 1e-6);  // of the column
  EXPECT_NEAR(place[3], std::cos(M_PI * 1.5 / 4), 1e-6);  // of the row
  for (size_t other = 0; other < made.rows; ++other) {
    if (other == row) continue;
    double apart = 0;
    for (size_t i = 0; i < made.colour_width; ++i) {
      apart += std::abs(static_cast<double>(place[i] - made.colour[other * made.colour_width + i]));
    }
    EXPECT_GT(apart, 1.0) << other;
  }
}

TEST(PatchCondition, SizesThatDoNotFitAreRefused) {
  EXPECT_THROW(patchCondition(ramps(64), {.canvas = 128, .patch = 16}), Error);
  EXPECT_THROW(validate(PatchSizes{.canvas = 100, .patch = 10}), Error);
  EXPECT_THROW(validate(PatchSizes{.canvas = 128, .patch = 12}), Error);
  EXPECT_THROW(validate(PatchSizes{.canvas = 128, .patch = 2}), Error);
}

}  // namespace
}  // namespace stipple
