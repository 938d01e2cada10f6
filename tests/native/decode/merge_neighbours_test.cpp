#include "decode/tree/merge_neighbours.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/parallel.h"

namespace stipple {
namespace {

/// Enough for several trees, in clumps and along x, so that neighbours lie in other trees too.
std::vector<double> manyPlaces(size_t count) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, 0.01);
  std::vector<double> places(count * 3);
  for (size_t i = 0; i < count; ++i) {
    places[i * 3] = static_cast<double>(i) / static_cast<double>(count) + normal(random);
    places[i * 3 + 1] = normal(random);
    places[i * 3 + 2] = normal(random);
  }
  return places;
}

double squaredDistance(const std::vector<double>& places, size_t a, size_t b) {
  double sum = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double across = places[a * 3 + axis] - places[b * 3 + axis];
    sum += across * across;
  }
  return sum;
}

TEST(NearestNeighbours, AreThoseThatAreFoundOneByOneWherePlacesAreMany) {
  constexpr size_t kCount = 40000;
  constexpr size_t kNeighbours = 6;
  const std::vector<double> places = manyPlaces(kCount);
  const std::vector<uint32_t> rows = nearestNeighbours(places, kNeighbours);
  ASSERT_EQ(rows.size(), kCount * kNeighbours);
  for (size_t i = 0; i < kCount; i += 131) {
    std::vector<double> all;
    for (size_t other = 0; other < kCount; ++other) {
      if (other != i) all.push_back(squaredDistance(places, i, other));
    }
    std::partial_sort(all.begin(), all.begin() + kNeighbours, all.end());
    for (size_t k = 0; k < kNeighbours; ++k) {
      const uint32_t found = rows[i * kNeighbours + k];
      ASSERT_LT(found, kCount);
      ASSERT_NE(found, i);
      // Places are rounded to float32: distances of 1e-3 and more to 1e-7.
      EXPECT_NEAR(std::sqrt(squaredDistance(places, i, found)), std::sqrt(all[k]), 1e-6);
    }
  }
}

TEST(NearestNeighbours, AreTheSameForAnyNumberOfThreads) {
  const std::vector<double> places = manyPlaces(30000);
  std::vector<uint32_t> rows[2];
  for (unsigned threads : {1u, 2u}) {
    withThreads(threads, [&] { rows[threads - 1] = nearestNeighbours(places, 6); });
  }
  EXPECT_EQ(rows[0], rows[1]);
}

}  // namespace
}  // namespace stipple
