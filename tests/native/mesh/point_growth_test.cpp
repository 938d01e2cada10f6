#include "mesh/point_growth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/parallel.h"

namespace stipple {
namespace {

using Mask = std::vector<uint8_t>;

double squaredDistance(const std::vector<float>& points, size_t a, size_t b) {
  double sum = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double d =
        static_cast<double>(points[a * 3 + k]) - static_cast<double>(points[b * 3 + k]);
    sum += d * d;
  }
  return sum;
}

Mask plainlyGrown(const std::vector<float>& points, const Mask& mask, double distance) {
  Mask result = mask;
  for (size_t i = 0; i < mask.size(); ++i) {
    for (size_t j = 0; j < mask.size() && !result[i]; ++j) {
      result[i] = mask[j] && squaredDistance(points, i, j) <= distance * distance ? 1 : 0;
    }
  }
  return result;
}

Mask inverted(Mask mask) {
  for (uint8_t& value : mask) value ^= 1;
  return mask;
}

void expectAsPlainly(const std::vector<float>& points, const Mask& mask, double distance) {
  EXPECT_EQ(grown(points, mask, distance), plainlyGrown(points, mask, distance)) << distance;
  EXPECT_EQ(shrunken(points, mask, distance),
            inverted(plainlyGrown(points, inverted(mask), distance)))
      << distance;
}

std::vector<float> randomPoints(size_t count, float extent, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-extent, extent);
  std::vector<float> points(count * 3);
  for (float& value : points) value = u(random);
  return points;
}

Mask everyNth(size_t count, size_t n) {
  Mask mask(count, 0);
  for (size_t i = 0; i < count; i += n) mask[i] = 1;
  return mask;
}

TEST(PointGrowth, GoesByTheDefinition) {
  const std::vector<float> points = randomPoints(800, 1, 3);
  for (const size_t n : {2, 9, 300}) {
    for (const double distance : {0.01, 0.1, 0.3, 4.0}) {
      expectAsPlainly(points, everyNth(800, n), distance);
    }
  }
}

TEST(PointGrowth, IncludesWhatIsExactlyAsFarAway) {
  // A lattice of side 1/4: all distances are exact.
  std::vector<float> points;
  for (int i = 0; i < 512; ++i) {
    for (const int v : {i % 8, i / 8 % 8, i / 64}) points.push_back(0.25f * static_cast<float>(v));
  }
  for (const double distance : {0.25, 0.5, 0.75})
    expectAsPlainly(points, everyNth(512, 7), distance);
  Mask one(512, 0);
  one[0] = 1;
  const Mask next = grown(points, one, 0.25);
  EXPECT_EQ(std::count(next.begin(), next.end(), 1), 4);
}

TEST(PointGrowth, KnowsCrowdsAndFarAwayPoints) {
  std::vector<float> points = randomPoints(600, 1e-3f, 5);
  const std::vector<float> far = randomPoints(100, 1e9f, 6);
  points.insert(points.end(), far.begin(), far.end());
  points.insert(points.end(), 300, 0.5f);  // 100 at one place
  // Cells of the first distance would need more numbers than there are.
  for (const double distance : {1e-5, 1e-4, 1.0, 1e8})
    expectAsPlainly(points, everyNth(800, 5), distance);
}

TEST(PointGrowth, OfNothingAndAllIsThat) {
  const std::vector<float> points = randomPoints(50, 1, 1);
  const Mask none(50, 0), all(50, 1);
  EXPECT_EQ(grown(points, none, 3), none);
  EXPECT_EQ(shrunken(points, all, 3), all);
  EXPECT_EQ(grown(points, all, 3), all);
  EXPECT_TRUE(grown({}, {}, 1).empty());
  EXPECT_EQ(neighbourSpacing(points, none), 0);
  // At distance 0 only what lies at the same place belongs together.
  const std::vector<float> twins = {0, 0, 0, 0, 0, 0, 1, 0, 0};
  EXPECT_EQ(grown(twins, Mask{1, 0, 0}, 0), (Mask{1, 1, 0}));
}

TEST(PointGrowth, TakesTheMedianDistanceToTheEighthNeighbour) {
  // In a row, the eighth neighbour is four further, and twice as far at the ends.
  std::vector<float> points(300, 0.0f);
  for (size_t i = 0; i < 100; ++i) points[i * 3] = 0.5f * static_cast<float>(i);
  EXPECT_EQ(neighbourSpacing(points, Mask(100, 1)), 2.0);
  Mask end(100, 0);
  end[0] = 1;
  EXPECT_EQ(neighbourSpacing(points, end), 4.0);
}

TEST(PointGrowth, NumberOfThreadsChangesNothing) {
  const std::vector<float> points = randomPoints(70000, 1, 9);
  const Mask mask = everyNth(70000, 50);
  std::vector<Mask> results;
  for (const unsigned threads : {1u, 3u}) {
    withThreads(threads, [&] { results.push_back(grown(points, mask, 0.02)); });
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_NE(results[0], mask);
}

}  // namespace
}  // namespace stipple
