#include "plot/plot_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "base/error.h"
#include "plot/text_outlines.h"
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

TEST(PlotImage, CoversThePixelsOfAStroke) {
  // Two pixels wide around y = 5: rows 4 and 5 whole; its ends are round.
  const Image image = imageOf(sheet({stroke({{4, 5}, {16, 5}}, 2)}), 1);
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

TEST(PlotImage, AStrokeThatCrossesItselfCoversOnce) {
  PlotMark cross = stroke({{2, 5}, {18, 5}, {10, 1}, {10, 9}}, 2);
  cross.opacity = 0.5;
  const Image image = imageOf(sheet({cross}), 1);
  EXPECT_FLOAT_EQ(red(image, 5, 5), 0.5f);
  EXPECT_FLOAT_EQ(red(image, 10, 5), 0.5f);
}

TEST(PlotImage, FillsABoxAndADotByTheirArea) {
  PlotMark box;
  box.kind = PlotMark::Kind::kBox;
  box.points = {{2, 2}, {5.5, 4}};
  box.colour = 0xff0000;
  PlotMark dot;
  dot.kind = PlotMark::Kind::kDot;
  dot.points = {{14, 5}};
  dot.size = 3;
  const Image image = imageOf(sheet({box, dot}), 1);
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

TEST(PlotImage, GrowsWithItsScaleAndRefusesOthers) {
  const Image image = imageOf(sheet({stroke({{4, 5}, {16, 5}}, 2)}), 2.5);
  EXPECT_EQ(image.width, 50u);
  EXPECT_EQ(image.height, 25u);
  expectError(ErrorCode::kInvalidArgument, {"scale", "0.25 to 8"}, [] { imageOf(sheet({}), 0.1); });
  expectError(ErrorCode::kInvalidArgument, {"scale"}, [] { imageOf(sheet({}), 9); });
}

TEST(PlotImage, ShowsTextWhereItIsAnchored) {
  const auto columns = [](TextAnchor anchor) {
    PlotMark text;
    text.kind = PlotMark::Kind::kText;
    text.points = {{10, 9}};
    text.size = 5;
    text.anchor = anchor;
    text.text = "HH";
    const Image image = imageOf(sheet({text}), 4);
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
  // The sides of H stand a tenth of 20 pixels inside its width.
  EXPECT_NEAR(columns(TextAnchor::kStart).first, 40 + 2, 1.5);
  EXPECT_NEAR(columns(TextAnchor::kEnd).second, 40 - 3, 1.5);
  const auto [first, last] = columns(TextAnchor::kMiddle);
  EXPECT_NEAR(0.5 * (first + last), 39.5, 1);
}

/// What a text covers, by pixel.
std::map<std::pair<int, int>, float> covered(const OutlinedText& text) {
  std::map<std::pair<int, int>, float> shares;
  coverText(text, [&](int x, int y, float share) {
    float& kept = shares[{x, y}];
    kept = std::max(kept, share);
  });
  return shares;
}

OutlinedText lettered(const std::string& text, double size) {
  OutlinedText made;
  made.text = text;
  made.size_px = size;
  made.x = 10;
  made.y = 30;
  return made;
}

TEST(TextOutlines, HaveEveryLetterOnceAndInItsPlace) {
  constexpr double kSize = 20;
  for (const bool is_bold : {false, true}) {
    std::set<std::map<std::pair<int, int>, float>> seen;
    for (char c = ' ' + 1; c < 0x7f; ++c) {
      OutlinedText letter = lettered(std::string(1, c), kSize);
      letter.is_bold = is_bold;
      const auto shares = covered(letter);
      ASSERT_FALSE(shares.empty()) << c;
      for (const auto& [place, share] : shares) {
        // No letter of DejaVu Sans leaves its em square by more than a tenth, and edges a pixel.
        EXPECT_GE(place.first, 10 - 3) << c;
        EXPECT_LE(place.first, 10 + lengthOf(letter) + 3) << c;
        EXPECT_GE(place.second, 30 - kSize) << c;
        EXPECT_LE(place.second, 30 + 0.3 * kSize) << c;
        EXPECT_GT(share, 0.0f);
        EXPECT_LE(share, 1.0f);
      }
      EXPECT_TRUE(seen.insert(shares).second) << c;
    }
  }
}

TEST(TextOutlines, MeasureLengthsInHeightsOfALine) {
  EXPECT_EQ(lengthOf(lettered("", 10)), 0.0);
  EXPECT_TRUE(covered(lettered(" ", 10)).empty());
  // 1540 of 2048 units an em: the advance of H in DejaVu Sans. Single precision scales it.
  EXPECT_NEAR(lengthOf(lettered("HH", 20)), 2 * 20 * 1540 / 2048.0, 1e-4);
  // Kerned: the crossbar of T reaches over o.
  EXPECT_LT(lengthOf(lettered("To", 20)),
            lengthOf(lettered("T", 20)) + lengthOf(lettered("o", 20)));
  OutlinedText bold = lettered("HH", 20);
  bold.is_bold = true;
  EXPECT_GT(lengthOf(bold), lengthOf(lettered("HH", 20)));
}

TEST(TextOutlines, DrawOneQuestionMarkForACharacterTheyLack) {
  EXPECT_EQ(covered(lettered("\xc3\xa9", 20)), covered(lettered("?", 20)));
  EXPECT_EQ(covered(lettered("\x01", 20)), covered(lettered("?", 20)));
}

TEST(TextOutlines, RunUpwardsAsTheyRunToTheRight) {
  const OutlinedText right = lettered("dB", 16);
  OutlinedText up = right;
  up.is_upright = false;
  const auto expected = covered(right);
  const auto seen = covered(up);
  ASSERT_EQ(seen.size(), expected.size());
  for (const auto& [place, share] : expected) {
    // A quarter rotation around the start (10, 30): right becomes up, up becomes left.
    const std::pair turned(10 + (place.second - 30), 30 - (place.first - 10) - 1);
    ASSERT_EQ(seen.count(turned), 1u) << place.first << ", " << place.second;
    // A step of 8 bits, and one more for sums in another order.
    EXPECT_NEAR(seen.at(turned), share, 2.0 / 255) << place.first << ", " << place.second;
  }
}

}  // namespace
}  // namespace stipple
