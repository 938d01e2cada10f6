#include "plot/plot_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "base/error.h"
#include "plot/stroke_font.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

PlotSheet sheet(std::vector<PlotMark> marks) {
  return {20, 10, std::move(marks)};
}

PlotMark stroke(std::vector<std::array<double, 2>> points, double width) {
  PlotMark mark;
  mark.points = std::move(points);
  mark.size = width;
  return mark;
}

float red(const Image& image, uint32_t x, uint32_t y) {
  return image.pixels[4 * (static_cast<size_t>(y) * image.width + x)];
}

TEST(PlotPicture, CoversThePixelsOfAStroke) {
  // Two pixels wide around y = 5: rows 4 and 5 whole; its ends are round.
  const Image image = pictureOf(sheet({stroke({{4, 5}, {16, 5}}, 2)}), 1);
  ASSERT_EQ(image.width, 20u);
  ASSERT_EQ(image.height, 10u);
  EXPECT_EQ(image.transfer, Transfer::kSrgb);
  for (uint32_t x = 5; x < 15; ++x) {
    EXPECT_EQ(red(image, x, 3), 1.0f);
    EXPECT_EQ(red(image, x, 4), 0.0f);
    EXPECT_EQ(red(image, x, 5), 0.0f);
    EXPECT_EQ(red(image, x, 6), 1.0f);
  }
  EXPECT_EQ(red(image, 1, 5), 1.0f);
  EXPECT_EQ(red(image, 18, 5), 1.0f);
}

TEST(PlotPicture, AStrokeThatCrossesItselfCoversOnce) {
  PlotMark cross = stroke({{2, 5}, {18, 5}, {10, 1}, {10, 9}}, 2);
  cross.opacity = 0.5;
  const Image image = pictureOf(sheet({cross}), 1);
  EXPECT_FLOAT_EQ(red(image, 5, 5), 0.5f);
  EXPECT_FLOAT_EQ(red(image, 10, 5), 0.5f);
}

TEST(PlotPicture, FillsABoxAndADotByTheirArea) {
  PlotMark box;
  box.kind = PlotMark::Kind::kBox;
  box.points = {{2, 2}, {5.5, 4}};
  box.colour = 0xff0000;
  PlotMark dot;
  dot.kind = PlotMark::Kind::kDot;
  dot.points = {{14, 5}};
  dot.size = 3;
  const Image image = pictureOf(sheet({box, dot}), 1);
  EXPECT_EQ(image.pixels[4 * (2 * 20 + 2) + 0], 1.0f);
  EXPECT_EQ(image.pixels[4 * (2 * 20 + 2) + 1], 0.0f);
  EXPECT_FLOAT_EQ(image.pixels[4 * (2 * 20 + 5) + 1], 0.5f);
  double area = 0;
  for (uint32_t y = 0; y < 10; ++y) {
    for (uint32_t x = 9; x < 20; ++x) area += 1.0 - static_cast<double>(red(image, x, y));
  }
  // Half a pixel of ramp on either side of an edge: 1 % of a disc of radius 3.
  EXPECT_NEAR(area, 3.14159265 * 9, 0.3);
}

TEST(PlotPicture, GrowsWithItsScaleAndRefusesOthers) {
  const Image image = pictureOf(sheet({stroke({{4, 5}, {16, 5}}, 2)}), 2.5);
  EXPECT_EQ(image.width, 50u);
  EXPECT_EQ(image.height, 25u);
  expectError(ErrorCode::kInvalidArgument, {"scale", "0.25 to 8"},
              [] { pictureOf(sheet({}), 0.1); });
  expectError(ErrorCode::kInvalidArgument, {"scale"}, [] { pictureOf(sheet({}), 9); });
}

TEST(PlotPicture, ShowsTextWhereItIsAnchored) {
  const auto columns = [](TextAnchor anchor) {
    PlotMark text;
    text.kind = PlotMark::Kind::kText;
    text.points = {{10, 9}};
    text.size = 5;
    text.anchor = anchor;
    text.text = "HH";
    const Image image = pictureOf(sheet({text}), 4);
    uint32_t first = image.width, last = 0;
    for (uint32_t x = 0; x < image.width; ++x) {
      for (uint32_t y = 0; y < image.height; ++y) {
        if (red(image, x, y) == 1) continue;
        first = std::min(first, x);
        last = std::max(last, x);
      }
    }
    return std::pair(first, last);
  };
  // Within the pen: half of it is 1 pixel, and its edge 1.
  EXPECT_NEAR(columns(TextAnchor::kStart).first, 40, 2);
  EXPECT_NEAR(columns(TextAnchor::kEnd).second, 40, 2);
  const auto [first, last] = columns(TextAnchor::kMiddle);
  EXPECT_NEAR(0.5 * (first + last), 39.5, 1);
}

TEST(StrokeFont, HasEveryLetterOnceAndInItsPlace) {
  std::set<std::vector<PenStroke>> seen;
  for (char c = ' ' + 1; c < 0x7f; ++c) {
    const std::string letter(1, c);
    const std::vector<PenStroke> strokes = penStrokes(letter);
    ASSERT_FALSE(strokes.empty()) << letter;
    for (const PenStroke& stroke : strokes) {
      ASSERT_FALSE(stroke.empty()) << letter;
      for (const auto& [x, y] : stroke) {
        EXPECT_GE(x, -0.8) << letter;
        EXPECT_LE(x, penWidth(letter) + 0.5) << letter;
        EXPECT_GE(y, -2.5) << letter;
        EXPECT_LE(y, 8.5) << letter;
      }
    }
    EXPECT_TRUE(seen.insert(strokes).second) << letter;
  }
  EXPECT_TRUE(penStrokes(" ").empty());
  EXPECT_EQ(penStrokes("\xc3"), penStrokes("?"));
  EXPECT_EQ(penWidth(""), 0.0);
  EXPECT_NEAR(penWidth("HH"), 2 * penWidth("H") + 1.9, 1e-9);
}

}  // namespace
}  // namespace stipple
