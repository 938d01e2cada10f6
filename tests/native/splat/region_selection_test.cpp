#include "splat/edit/region_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "base/error.h"
#include "base/stopwatch.h"
#include "splat/edit/lasso_outline.h"
#include "splat/edit/stroke_path.h"
#include "splat/random_scene.h"

namespace stipple {
namespace {

using testing::CloudRecipe;
using testing::randomCloud;

std::vector<float> wander(size_t count, float step, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> u(0, step);
  std::vector<float> points = {500, 400};
  while (points.size() < count * 2) points.push_back(points[points.size() - 2] + u(random));
  return points;
}

double distanceToPath(const std::vector<float>& points, double x, double y) {
  const auto at = [&](size_t i) { return static_cast<double>(points[i]); };
  double best = std::hypot(x - at(0), y - at(1));
  for (size_t i = 2; i + 1 < points.size(); i += 2) {
    const double dx = at(i) - at(i - 2), dy = at(i + 1) - at(i - 1);
    const double squared = dx * dx + dy * dy;
    const double t =
        squared > 0 ? std::clamp(((x - at(i - 2)) * dx + (y - at(i - 1)) * dy) / squared, 0.0, 1.0)
                    : 0.0;
    best = std::min(best, std::hypot(x - at(i - 2) - t * dx, y - at(i - 1) - t * dy));
  }
  return best;
}

bool isInOutline(const std::vector<float>& points, double x, double y) {
  bool inside = false;
  const size_t count = points.size() / 2;
  for (size_t i = 0; i < count; ++i) {
    const size_t j = (i + 1) % count;
    const double ax = static_cast<double>(points[i * 2]),
                 ay = static_cast<double>(points[i * 2 + 1]);
    const double bx = static_cast<double>(points[j * 2]),
                 by = static_cast<double>(points[j * 2 + 1]);
    if ((ay > y) != (by > y)) inside ^= x < ax + (y - ay) * ((bx - ax) / (by - ay));
  }
  return inside;
}

TEST(StrokePath, CoversWhatIsNearAnySegment) {
  struct Case {
    std::vector<float> points;
    double radius;
  };
  const std::vector<Case> cases = {
      {{500, 400}, 30},                      // a dot
      {{500, 400, 500, 400, 500, 400}, 30},  // a pen that rests
      {{400, 400, 600, 400}, 0.5},           // level
      {{500, 300, 500, 500, 500, 350}, 8},   // upright, and back
      {{500, 400, 501, 401}, 5000},          // a radius beyond the plane that is looked at
      {wander(300, 9, 1), 4},
      {wander(300, 9, 2), 70},
      {wander(20, 200, 3), 15},
  };
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0, 1000);
  for (size_t c = 0; c < cases.size(); ++c) {
    const StrokePath path(cases[c].points, cases[c].radius);
    size_t covered = 0;
    for (int i = 0; i < 5000; ++i) {
      const double x = u(random), y = u(random);
      const double distance = distanceToPath(cases[c].points, x, y);
      if (std::abs(distance - cases[c].radius) < 1e-9 * (1 + cases[c].radius)) continue;
      ASSERT_EQ(path.covers(x, y), distance <= cases[c].radius) << c << ": " << x << ", " << y;
      covered += path.covers(x, y) ? 1 : 0;
    }
    EXPECT_GT(covered, 0u) << c;
  }
}

TEST(StrokePath, LongestPathIsLaidInABoundedTime) {
  // Every segment crosses the whole image; by hand, each would look at every cell.
  std::vector<float> points;
  for (size_t i = 0; i < kMaxBrushPoints; ++i) {
    const auto x = static_cast<float>(i);
    points.insert(points.end(), {std::fmod(x * 617.3f, 2000.0f), i % 2 ? 0.0f : 1000.0f});
  }
  const Stopwatch watch;
  const StrokePath path(points, 3);
  EXPECT_LT(watch.seconds(), 2.0);  // 30 ms on an idle machine
  EXPECT_TRUE(path.covers(1000, 500));
  EXPECT_FALSE(path.covers(1000, 1100));
}

TEST(LassoOutline, IsTheEvenOddRuleBitForBit) {
  std::vector<std::vector<float>> outlines = {
      {0, 0, 1000, 0, 1000, 1000, 0, 1000},               // edges through whole numbers
      {100, 100, 900, 100, 500, 900},                     //
      {500, 0, 800, 1000, 0, 380, 1000, 380, 200, 1000},  // a star
      {0, 500, 1000, 500, 0, 500},                        // without area
      {10, 10, 10, 10, 10, 10},
      wander(1500, 15, 4),
  };
  std::mt19937 random(8);
  std::uniform_int_distribution<int> whole(0, 1000);
  std::uniform_real_distribution<double> u(0, 1000);
  for (size_t c = 0; c < outlines.size(); ++c) {
    const LassoOutline outline(outlines[c]);
    for (int i = 0; i < 4000; ++i) {
      const double x = i % 2 ? u(random) : whole(random);
      const double y = i % 2 ? u(random) : whole(random);
      ASSERT_EQ(outline.covers(x, y), isInOutline(outlines[c], x, y))
          << c << ": " << x << ", " << y;
    }
  }
  EXPECT_FALSE(LassoOutline(outlines[2]).covers(500, 500));  // the star's middle is wound twice
}

SplatCloud scattered(size_t count) {
  CloudRecipe recipe;
  recipe.count = count;
  return randomCloud(recipe, 5);
}

Region ball(const Vec3d& centre, double radius, RegionOperation operation) {
  Region region;
  region.kind = RegionKind::kSphere;
  region.operation = operation;
  region.centre = centre;
  region.radius = radius;
  return region;
}

TEST(RegionSelection, LongListsAreAppliedInOrder) {
  const SplatCloud cloud = scattered(3000);
  std::vector<Region> regions;
  std::vector<uint8_t> expected(cloud.size(), 0);
  for (int r = 0; r < 100; ++r) {
    const auto operation = static_cast<RegionOperation>(r % 7 == 6 ? 3 : 1 + r % 2);
    const Vec3d centre(std::sin(r), std::cos(2 * r), std::sin(3 * r));
    const double radius = operation == RegionOperation::kIntersect ? 2.5 : 0.8;
    regions.push_back(ball(centre, radius, operation));
    for (size_t i = 0; i < cloud.size(); ++i) {
      const Vec3d p(static_cast<double>(cloud.positions[i * 3]),
                    static_cast<double>(cloud.positions[i * 3 + 1]),
                    static_cast<double>(cloud.positions[i * 3 + 2]));
      const bool inside = (p - centre).squaredNorm() <= radius * radius;
      if (operation == RegionOperation::kAdd) expected[i] |= inside;
      if (operation == RegionOperation::kSubtract) expected[i] &= !inside;
      if (operation == RegionOperation::kIntersect) expected[i] &= inside;
    }
  }
  EXPECT_EQ(selectedByRegions(cloud, regions, std::vector<uint8_t>(cloud.size(), 0)), expected);
  EXPECT_GT(std::count(expected.begin(), expected.end(), 1), 10);
}

TEST(RegionSelection, OneWrongRegionChangesNothing) {
  const SplatCloud cloud = scattered(10);
  const std::vector<Region> regions = {ball(Vec3d::Zero(), 1, RegionOperation::kSet),
                                       ball(Vec3d::Zero(), -1, RegionOperation::kAdd)};
  try {
    selectedByRegions(cloud, regions, std::vector<uint8_t>(10, 1));
    FAIL() << "a negative radius was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(error.what(), "regions[1].radius is -1; 0 to 1e30 is allowed");
  }
}

TEST(RegionSelection, EmptyCloudHasAnEmptySelection) {
  Region grow;
  grow.kind = RegionKind::kGrow;
  const std::vector<Region> regions = {ball(Vec3d::Zero(), 1, RegionOperation::kSet), grow};
  EXPECT_TRUE(selectedByRegions(SplatCloud{}, regions, {}).empty());
}

}  // namespace
}  // namespace stipple
