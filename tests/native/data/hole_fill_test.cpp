#include "data/images/hole_fill.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/parallel.h"

// The definition is evaluated for each pixel by itself, in double.

namespace stipple {
namespace {

struct Picture {
  uint32_t width = 0, height = 0;
  std::vector<float> colour;
  std::vector<uint8_t> known;
};

Picture randomPicture(uint32_t width, uint32_t height, uint32_t one_in) {
  std::mt19937 random(width * 31 + height);
  Picture made{width, height, {}, {}};
  for (size_t i = 0; i < size_t{width} * height; ++i) {
    made.known.push_back(random() % one_in == 0 ? 1 : 0);
    for (int c = 0; c < 3; ++c) {
      const auto value = static_cast<float>(random() % 1000) / 100.0f;
      // What is not known may be anything.
      made.colour.push_back(made.known.back() ? value : NAN);
    }
  }
  return made;
}

/// The mean over the smallest square of 1, 2, 4, ... aside around a pixel that holds a known one.
double meanAround(const Picture& picture, size_t x, size_t y, size_t channel) {
  for (size_t side = 1; side < 2 * std::max(picture.width, picture.height); side *= 2) {
    const size_t left = x / side * side, top = y / side * side;
    double sum = 0, count = 0;
    for (size_t row = top; row < std::min<size_t>(top + side, picture.height); ++row) {
      for (size_t column = left; column < std::min<size_t>(left + side, picture.width); ++column) {
        const size_t at = row * picture.width + column;
        if (!picture.known[at]) continue;
        sum += static_cast<double>(picture.colour[at * 3 + channel]);
        ++count;
      }
    }
    if (count > 0) return sum / count;
  }
  return 0;
}

TEST(HoleFill, TakesTheMeanOfTheSmallestSquareThatKnowsAnything) {
  for (const auto& [width, height, one_in] :
       {std::tuple{1u, 1u, 1u}, {7u, 5u, 3u}, {64u, 33u, 50u}, {31u, 100u, 400u}}) {
    const Picture picture = randomPicture(width, height, one_in);
    const std::vector<float> filled = filledHoles(picture.colour, picture.known, width, height);
    ASSERT_EQ(filled.size(), picture.colour.size());
    for (size_t i = 0; i < filled.size(); ++i) {
      const size_t pixel = i / 3;
      // Sums of up to 3000 numbers below 10, in single precision level by level.
      ASSERT_NEAR(static_cast<double>(filled[i]),
                  meanAround(picture, pixel % width, pixel / width, i % 3), 1e-5)
          << width << " x " << height << ", pixel " << pixel;
    }
  }
}

TEST(HoleFill, KeepsWhatIsKnownAndIsBlackWhereNothingIs) {
  const Picture all = randomPicture(9, 6, 1);
  EXPECT_EQ(filledHoles(all.colour, all.known, 9, 6), all.colour);
  const std::vector<uint8_t> none(54, 0);
  EXPECT_EQ(filledHoles(all.colour, none, 9, 6), std::vector<float>(54 * 3, 0.0f));
}

TEST(HoleFill, HasTheSameBitsForAnyNumberOfThreads) {
  const Picture picture = randomPicture(301, 207, 20);
  std::vector<float> one, two;
  withThreads(1, [&] { one = filledHoles(picture.colour, picture.known, 301, 207); });
  withThreads(2, [&] { two = filledHoles(picture.colour, picture.known, 301, 207); });
  EXPECT_EQ(one, two);
}

}  // namespace
}  // namespace stipple
