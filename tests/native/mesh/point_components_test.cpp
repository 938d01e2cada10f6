#include "mesh/point_components.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/error.h"

namespace stipple {
namespace {

double distance(const std::vector<float>& points, size_t a, size_t b) {
  double squared = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double d =
        static_cast<double>(points[a * 3 + k]) - static_cast<double>(points[b * 3 + k]);
    squared += d * d;
  }
  return std::sqrt(squared);
}

/// The definition: neighbours of neighbours, by every pair.
std::vector<uint32_t> bruteForce(const std::vector<float>& points, double radius) {
  const size_t count = points.size() / 3;
  std::vector<uint32_t> group(count, UINT32_MAX);
  for (uint32_t first = 0; first < count; ++first) {
    if (group[first] != UINT32_MAX) continue;
    std::vector<uint32_t> open = {first};
    group[first] = first;
    while (!open.empty()) {
      const uint32_t at = open.back();
      open.pop_back();
      for (uint32_t other = 0; other < count; ++other) {
        if (group[other] == UINT32_MAX && distance(points, at, other) <= radius) {
          group[other] = first;
          open.push_back(other);
        }
      }
    }
  }
  return group;
}

std::vector<float> randomPoints(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-1, 1);
  std::vector<float> points(count * 3);
  for (float& value : points) value = u(random);
  return points;
}

TEST(PointComponents, AreThoseOfEveryPair) {
  const std::vector<float> points = randomPoints(1200, 4);
  for (const double radius : {0.02, 0.1, 0.13, 0.16, 0.3, 4.0}) {
    EXPECT_EQ(pointComponents(points, radius, nullptr), bruteForce(points, radius)) << radius;
  }
}

TEST(PointComponents, JoinAtExactlyTheRadiusAndNotBeyond) {
  const std::vector<float> points = {0, 0, 0, 1, 0, 0, 2.0001f, 0, 0, -1, 0, 0};
  EXPECT_EQ(pointComponents(points, 1.0, nullptr), (std::vector<uint32_t>{0, 0, 2, 0}));
}

TEST(PointComponents, TellCrowdsApartThatAreNearlyNeighbours) {
  // Two crowds of 3000, each within a cell, 1.05 radii apart at the nearest: every pair would be
  // nine million distances, and no pair joins them.
  std::vector<float> points = randomPoints(6000, 5);
  for (size_t i = 0; i < 6000; ++i) {
    for (size_t k = 0; k < 3; ++k) points[i * 3 + k] *= 0.1f;
    if (i % 2 == 1) points[i * 3] += 1.25f;
  }
  const std::vector<uint32_t> groups = pointComponents(points, 1.0, nullptr);
  for (size_t i = 0; i < 6000; ++i) EXPECT_EQ(groups[i], i % 2);
}

TEST(PointComponents, StandPointsAtOnePlaceAndFarAway) {
  std::vector<float> points(3 * 1000, 0.5f);
  points.insert(points.end(), {3e38f, -3e38f, 3e38f, 1e20f, 0, 0});
  const std::vector<uint32_t> groups = pointComponents(points, 1e-6, nullptr);
  EXPECT_EQ(std::count(groups.begin(), groups.end(), 0u), 1000);
  EXPECT_EQ(groups[1000], 1000u);
  EXPECT_EQ(groups[1001], 1001u);
  EXPECT_TRUE(pointComponents({}, 1, nullptr).empty());
}

TEST(PointComponents, StopWhenCancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_THROW(pointComponents(randomPoints(10, 1), 0.1, &progress), Error);
}

TEST(NeighbourDistances, AreThoseOfSortedPairs) {
  const std::vector<float> points = randomPoints(300, 6);
  const std::vector<uint32_t> queries = {0, 7, 299};
  const std::vector<double> found = neighbourDistances(points, queries, 8);
  for (size_t q = 0; q < queries.size(); ++q) {
    std::vector<double> all;
    for (size_t i = 0; i < 300; ++i) {
      if (i != queries[q]) all.push_back(distance(points, queries[q], i));
    }
    std::sort(all.begin(), all.end());
    EXPECT_DOUBLE_EQ(found[q], all[7]);
  }
  const std::vector<float> two = {0, 0, 0, 3, 4, 0};
  EXPECT_EQ(neighbourDistances(two, std::vector<uint32_t>{0}, 8), (std::vector<double>{5}));
}

}  // namespace
}  // namespace stipple
