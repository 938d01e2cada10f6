#include "train/networks/token_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "generate/sobol_points.h"

namespace stipple {
namespace {

std::vector<float> numbers(size_t count, uint64_t seed) {
  std::vector<float> made(count);
  for (size_t i = 0; i < count; ++i) {
    made[i] = unitFloat(keyedBits(seed, RandomUse::kNetworkStart, i));
  }
  return made;
}

double squared(const std::vector<float>& a, size_t i, const std::vector<float>& b, size_t j) {
  double sum = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double offset =
        static_cast<double>(a[i * 3 + axis]) - static_cast<double>(b[j * 3 + axis]);
    sum += offset * offset;
  }
  return sum;
}

/// Prices prove that nothing is cheaper: any other assignment costs their sum at least.
void expectProof(const std::vector<float>& points, const std::vector<float>& places,
                 const Assignment& found) {
  const size_t count = points.size() / 3;
  std::vector<uint8_t> is_taken(count, 0);
  double sum = 0, prices = 0;
  for (size_t i = 0; i < count; ++i) {
    ASSERT_LT(found.place_of[i], count);
    EXPECT_FALSE(is_taken[found.place_of[i]]);
    is_taken[found.place_of[i]] = 1;
    sum += squared(points, i, places, found.place_of[i]);
    prices += found.row[i] + found.column[i];
  }
  EXPECT_NEAR(found.cost, sum, 1e-9);
  EXPECT_NEAR(found.cost, prices, 1e-9);
  double worst = 0;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < count; ++j) {
      worst = std::min(worst, squared(points, i, places, j) - found.row[i] - found.column[j]);
    }
  }
  EXPECT_GE(worst, -1e-12);  // A path of a thousand sums of order one in double.
}

TEST(TokenOrder, IsTheCheapestOfAllPermutations) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const size_t count = 1 + seed % 7;
    const std::vector<float> points = numbers(count * 3, seed), places = numbers(count * 3, 999);
    const Assignment found = leastSquaresAssignment(points, places);
    expectProof(points, places, found);
    std::vector<uint32_t> order(count);
    std::iota(order.begin(), order.end(), 0u);
    double least = std::numeric_limits<double>::infinity();
    do {
      double cost = 0;
      for (size_t i = 0; i < count; ++i) cost += squared(points, i, places, order[i]);
      least = std::min(least, cost);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_NEAR(found.cost, least, 1e-12) << seed;
  }
}

TEST(TokenOrder, PricesProveItForManyPoints) {
  const std::vector<float> points = numbers(3 * 700, 5), places = sobolPoints(700);
  expectProof(points, places, leastSquaresAssignment(points, places));
}

TEST(TokenOrder, PointsInOnePlaceAreAssignedAllTheSame) {
  std::vector<float> points = numbers(3 * 64, 5);
  for (size_t i = 0; i < points.size(); ++i) points[i] = points[i % 6];  // Two places, 32 times.
  const std::vector<float> places = sobolPoints(64);
  expectProof(points, places, leastSquaresAssignment(points, places));
  const std::vector<float> one(3 * 32, 0.25f);
  expectProof(one, one, leastSquaresAssignment(one, one));
}

TEST(TokenOrder, FindsTheSequenceAgain) {
  const std::vector<float> places = sobolPoints(300);
  std::vector<uint32_t> mixed(300);
  std::iota(mixed.begin(), mixed.end(), 0u);
  std::sort(mixed.begin(), mixed.end(),
            [](uint32_t a, uint32_t b) { return mixBits(a) < mixBits(b); });
  std::vector<float> points;
  for (const uint32_t at : mixed) {
    points.insert(points.end(), &places[at * 3], &places[at * 3] + 3);
  }
  const std::vector<uint32_t> order = tokenOrder(points);
  for (uint32_t j = 0; j < 300; ++j) EXPECT_EQ(mixed[order[j]], j);
}

TEST(TokenOrder, RefusesWhatCannotBeAssigned) {
  EXPECT_THROW(leastSquaresAssignment(std::vector<float>(6), std::vector<float>(3)), Error);
  EXPECT_THROW(leastSquaresAssignment(std::vector<float>(3, std::nanf("")), std::vector<float>(3)),
               Error);
  EXPECT_TRUE(leastSquaresAssignment({}, {}).place_of.empty());
}

}  // namespace
}  // namespace stipple
