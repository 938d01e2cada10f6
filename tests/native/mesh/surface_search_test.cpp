#include "mesh/surface_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace stipple {
namespace {

double drawn(uint64_t stream, uint64_t index) {
  return 2 * unitDouble(keyedBits(stream, RandomUse::kThinning, index)) - 1;
}

Vec3d drawnPoint(uint64_t stream, uint64_t index) {
  return {drawn(stream, 3 * index), drawn(stream, 3 * index + 1), drawn(stream, 3 * index + 2)};
}

TEST(NearestOnTriangle, IsNotFartherThanAnyPlaceOfAGrid) {
  for (uint64_t round = 0; round < 300; ++round) {
    std::array<Vec3d, 3> corners = {drawnPoint(1, round), drawnPoint(2, round),
                                    drawnPoint(3, round)};
    // Slivers, edges and points as well.
    if (round % 5 == 1) corners[2] = corners[1] + 1e-9 * corners[0];
    if (round % 5 == 2) corners[2] = 0.3 * corners[0] + 0.7 * corners[1];
    if (round % 5 == 3) corners[1] = corners[2] = corners[0];
    const Vec3d point = 2 * drawnPoint(4, round);
    const SurfacePlace place = nearestOnTriangle(point, corners);
    Vec3d found = Vec3d::Zero();
    double sum = 0;
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_GE(place.weights[i], 0);
      sum += place.weights[i];
      found += place.weights[i] * corners[i];
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_NEAR((point - found).squaredNorm(), place.squared, 1e-9);
    constexpr int kSteps = 60;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const double a = static_cast<double>(i) / kSteps, b = static_cast<double>(j) / kSteps;
        const Vec3d other = (1 - a - b) * corners[0] + a * corners[1] + b * corners[2];
        ASSERT_GE((point - other).squaredNorm(), place.squared - 1e-9);
      }
    }
  }
}

TEST(SurfaceSearch, FindsWhatLookingAtAllTrianglesFinds) {
  std::vector<float> positions;
  std::vector<uint32_t> triangles;
  for (uint64_t t = 0; t < 500; ++t) {
    const Vec3d middle = drawnPoint(5, t);
    for (uint64_t corner = 0; corner < 3; ++corner) {
      // Large triangles beside small ones.
      const Vec3d at = middle + (t % 10 == 0 ? 0.8 : 0.05) * drawnPoint(6, 3 * t + corner);
      for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(at[axis]));
      triangles.push_back(static_cast<uint32_t>(triangles.size()));
    }
  }
  const SurfaceSearch search(positions, triangles);
  std::vector<SurfacePlace> found;
  for (uint64_t i = 0; i < 200; ++i) {
    const Vec3d point = 1.5 * drawnPoint(7, i);
    std::vector<SurfacePlace> all;
    for (uint32_t t = 0; t < 500; ++t) {
      std::array<Vec3d, 3> corners;
      for (size_t c = 0; c < 3; ++c) {
        const float* at = positions.data() + size_t{3} * triangles[size_t{3} * t + c];
        corners[c] = Vec3d(at[0], at[1], at[2]);
      }
      all.push_back(nearestOnTriangle(point, corners));
      all.back().triangle = t;
    }
    std::stable_sort(all.begin(), all.end(), [](const SurfacePlace& a, const SurfacePlace& b) {
      return a.squared < b.squared;
    });
    for (const size_t count : {size_t{1}, size_t{7}, size_t{500}, size_t{900}}) {
      search.nearest(point, count, found);
      ASSERT_EQ(found.size(), std::min<size_t>(count, 500));
      for (size_t k = 0; k < found.size(); ++k) {
        ASSERT_EQ(found[k].triangle, all[k].triangle);
        ASSERT_EQ(found[k].squared, all[k].squared);
      }
    }
  }
}

TEST(SurfaceSearch, OfEqualTrianglesTheFirstIsFound) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::vector<uint32_t> triangles;
  for (int copy = 0; copy < 50; ++copy) triangles.insert(triangles.end(), {0, 1, 2});
  std::vector<SurfacePlace> found;
  SurfaceSearch(positions, triangles).nearest({0.2, 0.2, 5}, 3, found);
  ASSERT_EQ(found.size(), 3u);
  for (uint32_t k = 0; k < 3; ++k) EXPECT_EQ(found[k].triangle, k);
  EXPECT_NEAR(found[0].squared, 25, 1e-12);
}

}  // namespace
}  // namespace stipple
