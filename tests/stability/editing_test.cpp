#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "splat/edit/hole_filling.h"
#include "splat/edit/region_selection.h"
#include "splat/random_scene.h"

// Selections by regions, and filled holes, of clouds and regions that are hard, with floating-point
// traps on.

namespace stipple::testing {
namespace {

struct Hard {
  std::string name;
  SplatCloud cloud;
};

/// A square of ground, its splats flat; the ones in the middle are the hole.
SplatCloud ground(size_t count, uint32_t seed) {
  CloudRecipe recipe;
  recipe.count = count;
  recipe.degree = 2;
  SplatCloud cloud = randomCloud(recipe, seed);
  for (size_t i = 0; i < count; ++i) cloud.positions[i * 3 + 2] *= 1e-3f;
  return cloud;
}

std::vector<Hard> hardClouds() {
  std::vector<Hard> cases;
  const auto add = [&](const char* name, SplatCloud cloud) {
    cases.push_back({name, std::move(cloud)});
  };
  add("ground", ground(800, 1));
  add("two splats", ground(2, 2));
  SplatCloud c = ground(800, 3);
  std::ranges::fill(c.positions, 0.25f);
  add("all at one point", c);
  c = ground(800, 4);
  for (size_t i = 0; i < c.size(); ++i) c.positions[i * 3 + 1] = c.positions[i * 3 + 2] = 0;
  add("all on a line", c);
  c = ground(800, 5);
  for (size_t i = 0; i < c.size(); ++i) {
    c.scales[i * 3] = 1.0f;
    c.scales[i * 3 + 1] = c.scales[i * 3 + 2] = 1e-6f;
  }
  add("needles of one to a million", c);
  c = ground(800, 6);
  std::ranges::fill(c.scales, 0.0f);
  add("points", c);
  c = ground(800, 7);
  for (float& x : c.positions) x += 1e6f;
  add("1e6 from the origin", c);
  for (const float size : {1e-30f, 1e-12f, 1e12f}) {
    c = ground(800, 8);
    for (float& x : c.positions) x *= size;
    for (float& x : c.scales) x *= size;
    add(size < 1 ? "tiny coordinates" : "huge coordinates", c);
  }
  c = ground(800, 9);
  c.positions[0] = 1e15f;
  c.positions[4] = -1e15f;
  add("outliers of 1e15", c);
  c = ground(800, 10);
  for (float& value : c.sh) value *= 1e30f;
  add("colours of 1e30", c);
  c = ground(800, 11);
  std::ranges::fill(c.opacities, 0.0f);
  add("opacity 0", c);
  return cases;
}

Region region(RegionKind kind) {
  Region made;
  made.kind = kind;
  return made;
}

/// Regions of every kind, at the limits of what is accepted.
std::vector<Region> hardRegions() {
  static const std::vector<float> far = {-1e30f, 1e30f, 1e30f, -1e30f, 0, 0};
  static const std::vector<float> tiny = {0, 0, 1e-38f, 1e-38f, 1e-45f, 0};
  static const std::vector<float> depths = {1, std::numeric_limits<float>::infinity(),
                                            -std::numeric_limits<float>::infinity(), 0};
  std::vector<Region> regions = {region(RegionKind::kAll)};
  for (const auto& points : {far, tiny}) {
    for (const double radius : {0.0, 5e-324, 1e-300, 1e30}) {
      Region brush = region(RegionKind::kBrush);
      brush.points = points.data() == far.data() ? std::span(far) : std::span(tiny);
      brush.radius = radius;
      regions.push_back(brush);
    }
    Region lasso = region(RegionKind::kLasso);
    lasso.points = points.data() == far.data() ? std::span(far) : std::span(tiny);
    regions.push_back(lasso);
  }
  Region view = region(RegionKind::kBrush);  // W is z: some are on the camera's plane
  view.points = std::span(far);
  view.radius = 1;
  view.cloud_to_pixels.row(3) = Vec4d(0, 0, 1, 0);
  regions.push_back(view);
  view.kind = RegionKind::kAll;
  view.seen = {depths, 2, 2, Vec4d(-1, -1, 1, 1), 1e30, true};
  regions.push_back(view);
  for (const double radius : {0.0, 1e-300, 1e30}) {
    Region ball = region(RegionKind::kSphere);
    ball.centre = Vec3d::Constant(radius);
    ball.radius = radius;
    regions.push_back(ball);
    Region colour = region(RegionKind::kColour);
    colour.colour = Vec3d::Constant(-radius);
    colour.tolerance = radius;
    regions.push_back(colour);
  }
  for (const double distance : {0.0, 1e-300, 1e-3, 1e30, -1e-300, -1e-3, -1e30}) {
    Region half = region(RegionKind::kSphere);
    half.radius = 0.5;
    regions.push_back(half);
    Region grow = region(RegionKind::kGrow);
    grow.distance = distance;
    regions.push_back(grow);
  }
  return regions;
}

TEST(EditingStability, EveryRegionSelectsOfEveryCloud) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    const std::vector<uint8_t> nothing(hard.cloud.size(), 0);
    const std::vector<Region> regions = hardRegions();
    std::vector<uint8_t> mask;
    for (size_t r = 0; r < regions.size(); ++r) {
      SCOPED_TRACE(r);
      mask = selectedByRegions(hard.cloud, std::span(regions).first(r + 1), nothing);
      EXPECT_TRUE(std::ranges::all_of(mask, [](uint8_t value) { return value <= 1; }));
    }
    Region sign = region(RegionKind::kGrow);
    sign.distance = 1e30;  // whatever was selected, everything is that near
    const std::vector<Region> all = {regions[0], sign};
    mask = selectedByRegions(hard.cloud, all, nothing);
    EXPECT_TRUE(std::ranges::all_of(mask, [](uint8_t value) { return value == 1; }));
  }
}

TEST(EditingStability, EveryHoleIsFilledOrTheReportSaysWhyNot) {
  for (const Hard& hard : hardClouds()) {
    SCOPED_TRACE(hard.name);
    const size_t count = hard.cloud.size();
    for (const size_t first : {count / 2, count - 1}) {  // a half, and one splat
      std::vector<uint8_t> removed(count, 0);
      std::fill(removed.begin() + static_cast<std::ptrdiff_t>(first), removed.end(), uint8_t{1});
      FillReport report;
      const SplatCloud made = holesFilled(hard.cloud, removed, {}, report, nullptr);
      EXPECT_NO_THROW(validate(made, "filled"));
      EXPECT_EQ(report.splat_count, made.size());
      EXPECT_EQ(report.hole_count, report.filled_count + report.no_ring_count +
                                       report.no_plane_count + report.covered_count);
      EXPECT_GE(report.hole_count, 1u);
    }
  }
}

TEST(EditingStability, TwoSplatsAreNoRing) {
  SplatCloud cloud = ground(802, 12);
  std::vector<uint8_t> removed(802, 1);
  removed[0] = removed[1] = 0;
  FillReport report;
  EXPECT_EQ(holesFilled(cloud, removed, {}, report, nullptr).size(), 0u);
  EXPECT_EQ(report.no_ring_count, report.hole_count);
}

TEST(EditingStability, FarFromTheOriginAHoleIsFilledAsNearIt) {
  SplatCloud cloud = ground(4000, 13);
  std::vector<uint8_t> removed(4000, 0);
  for (size_t i = 0; i < 4000; ++i) {
    removed[i] = std::hypot(cloud.positions[i * 3], cloud.positions[i * 3 + 1]) < 0.3f ? 1 : 0;
    // Steps of float32 at a million are 1/16: the cloud is as much larger, so that it has as many.
    for (size_t k = 0; k < 3; ++k) cloud.positions[i * 3 + k] *= 1e5f;
  }
  FillReport near, far;
  const SplatCloud expected = holesFilled(cloud, removed, {}, near, nullptr);
  for (float& x : cloud.positions) x += 1e6f;
  const SplatCloud made = holesFilled(cloud, removed, {}, far, nullptr);
  EXPECT_EQ(near.filled_count, 1u);
  EXPECT_EQ(far.filled_count, 1u);
  const auto counts = [](const SplatCloud& c) { return static_cast<double>(c.size()); };
  EXPECT_NEAR(counts(made) / counts(expected), 1, 0.2);
  for (size_t i = 0; i < made.size(); ++i) {
    EXPECT_NEAR(made.positions[i * 3 + 2], 1e6f, 150.0f);  // the ground is 1e5 x 1e-3 thick
    EXPECT_LT(std::hypot(made.positions[i * 3] - 1e6f, made.positions[i * 3 + 1] - 1e6f), 4e4f);
  }
}

}  // namespace
}  // namespace stipple::testing
