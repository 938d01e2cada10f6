#include "splat/edit/hole_filling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "splat/edit/hole_raster.h"
#include "splat/edit/local_surface.h"
#include "splat/edit/patch_quilt.h"

// What a filled cloud is like is tested through the C header (tests/addon/test_regions.py); here
// are its steps.

namespace stipple {
namespace {

using Cell = HoleRaster::Cell;

std::vector<Vec3d> pointsOf(double (*height)(double, double), double noise) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-2, 2);
  std::normal_distribution<double> n(0, 1);
  std::vector<Vec3d> points;
  while (points.size() < 3000) {
    const double x = u(random), y = u(random);
    if (std::hypot(x, y) > 1) points.emplace_back(x, y, height(x, y) + noise * n(random));
  }
  return points;
}

TEST(LocalSurface, OfAPlaneIsThePlane) {
  const auto points = pointsOf([](double x, double y) { return 0.1 * x - 0.2 * y + 3; }, 0);
  // A plane that is a little off: what is left of the slope is fitted.
  const LocalSurface surface({Vec3d::UnitZ(), 3}, Vec3d(0.2, 0.1, 50), points, 1);
  const LocalSurface::Place place = surface.placeOf(Vec3d(0.3, 0.4, 0.03 - 0.08 + 3.5));
  EXPECT_NEAR(place.h, 0.5, 1e-12);
  const Vec3d back = surface.pointAt({place.u, place.v, 0});
  EXPECT_NEAR((back - Vec3d(0.3, 0.4, 0.03 - 0.08 + 3)).norm(), 0, 1e-12);
  EXPECT_EQ(surface.turn(0, 0, 1, 1), Mat3d(Mat3d::Identity()));
}

TEST(LocalSurface, BridgesAHoleOfABentGround) {
  const auto height = [](double x, double y) { return 0.05 * x * x - 0.03 * x * y + 0.02 * y; };
  const LocalSurface surface({Vec3d::UnitZ(), 0}, Vec3d::Zero(), pointsOf(height, 0), 1);
  EXPECT_NEAR(surface.placeOf(Vec3d(0.5, -0.4, height(0.5, -0.4))).h, 0, 1e-12);
  // The turn leads one normal to the other: gradients (0.1 x - 0.03 y, -0.03 x + 0.02).
  const LocalSurface::Place a = surface.placeOf(Vec3d(0, 0, 0));
  const LocalSurface::Place b = surface.placeOf(Vec3d(0.5, -0.4, 0));
  const Vec3d from = Vec3d(0, -0.02, 1).normalized();
  const Vec3d to = Vec3d(-(0.05 + 0.012), 0.015 - 0.02, 1).normalized();
  const Mat3d turn = surface.turn(a.u, a.v, b.u, b.v);
  EXPECT_NEAR((turn * from - to).norm(), 0, 1e-12);
  EXPECT_NEAR((turn * turn.transpose() - Mat3d::Identity()).norm(), 0, 1e-12);
}

TEST(LocalSurface, IsNotMovedByWhatStandsOnTheGround) {
  auto points = pointsOf([](double, double) { return 0.0; }, 0.01);
  for (size_t i = 0; i < 600; ++i) points.push_back(points[i] + Vec3d(0, 0, 0.5));
  const LocalSurface surface({Vec3d::UnitZ(), 0}, Vec3d::Zero(), points, 1);
  // 3000 heights of 0.01 leave 0.0002; the others would lift it by 0.08.
  EXPECT_NEAR(surface.placeOf(Vec3d::Zero()).h, 0, 0.002);
  EXPECT_NEAR(surface.band(), 0.05, 0.02);  // five deviations
}

TEST(LocalSurface, DoesNotBendBeyondWhereItIsKnown) {
  auto points = pointsOf([](double x, double) { return x > 0 ? 0.02 * x * x : 0.0; }, 0);
  std::erase_if(points, [](const Vec3d& p) { return p[0] < 1; });  // from one side only
  const LocalSurface surface({Vec3d::UnitZ(), 0.05}, Vec3d::Zero(), points, 1);
  EXPECT_EQ(surface.turn(1, 0, -5, 3), Mat3d(Mat3d::Identity()));
}

/// '#' is ground, 'T' ground with something on it, 'x' removed ground, 'o' removed above the
/// ground,
/// '.' nothing, 'w' ground where a wide splat was removed nearby; four splats each.
HoleRaster labelled(const std::vector<std::string>& rows) {
  HoleRaster raster;
  raster.width = rows[0].size();
  raster.height = rows.size();
  HoleCounts counts;
  for (auto* values : {&counts.left, &counts.removed, &counts.above, &counts.things,
                       &counts.left_cover, &counts.removed_cover}) {
    values->resize(raster.size());
  }
  for (size_t i = 0; i < raster.size(); ++i) {
    const char kind = rows[i / raster.width][i % raster.width];
    if (kind == '#' || kind == 'T') counts.left[i] = 4;
    counts.left_cover[i] = kind == '#' ? 0.9f : 0.2f;
    if (kind == 'w' || kind == 'x') counts.removed_cover[i] = 0.9f;
    if (kind == 'T') counts.things[i] = 4;
    if (kind == 'x') counts.removed[i] = 4;
    if (kind == 'x' || kind == 'o') counts.above[i] = 4;
  }
  labelCells(raster, counts);
  return raster;
}

std::vector<std::string> picture(const HoleRaster& raster) {
  std::vector<std::string> rows(raster.height, std::string(raster.width, '.'));
  for (size_t i = 0; i < raster.size(); ++i) {
    if (raster.cells[i] == Cell::kSolid) rows[i / raster.width][i % raster.width] = '#';
    if (raster.cells[i] == Cell::kHole) rows[i / raster.width][i % raster.width] = 'x';
  }
  return rows;
}

TEST(HoleRaster, FollowsWhatIsRemoved) {
  const std::vector<std::string> rows = {"########", "########", "##xxxx##",
                                         "##xxxx##", "########", "########"};
  EXPECT_EQ(picture(labelled(rows)), rows);
}

TEST(HoleRaster, ClosesWhatNobodyHasSeenBelowAThing) {
  // The sides of a box, at any height, hide the ground inside; a lid over whole ground hides none.
  const std::vector<std::string> box = {"#########", "#########", "##ooooo##",
                                        "##o...o##", "##o...o##", "##o...o##",
                                        "##ooooo##", "#########", "#########"};
  const HoleRaster raster = labelled(box);
  EXPECT_EQ(raster.cells[4 * 9 + 4], Cell::kHole);
  // At its corners more of the ground is around a cell than of the box.
  EXPECT_EQ(raster.count(Cell::kHole), 21u);
  HoleRaster lid = labelled(std::vector<std::string>(9, std::string(9, '#')));
  EXPECT_EQ(lid.count(Cell::kHole), 0u);
}

TEST(HoleRaster, KnowsWhereSomethingStands) {
  const HoleRaster raster = labelled({"######", "##TT##", "##TT##", "######"});
  EXPECT_EQ(raster.count(Cell::kThing), 4u);
  EXPECT_EQ(raster.count(Cell::kSolid), 20u);
}

TEST(HoleRaster, MissesWhatAWideSplatHasCovered) {
  const HoleRaster raster = labelled({"######", "#xww##", "#xww##", "######"});
  EXPECT_EQ(picture(raster), (std::vector<std::string>{"######", "#xxx##", "#xxx##", "######"}));
}

TEST(HoleRaster, DoesNotGrowBeyondTheEndOfTheGround) {
  const std::vector<std::string> rows = {"########....", "########....", "####xxxx....",
                                         "####xxxx....", "########....", "########...."};
  const HoleRaster raster = labelled(rows);
  for (size_t i = 0; i < raster.size(); ++i) {
    if (i % 12 > 8) {
      EXPECT_EQ(raster.cells[i], Cell::kEmpty) << i;
    }
  }
  EXPECT_GE(raster.count(Cell::kHole), 8u);
}

/// A raster of ground with a square hole, in stripes along x.
struct Striped {
  HoleRaster raster;
  std::vector<CellLook> looks;
  explicit Striped(size_t period) {
    raster.width = raster.height = 64;
    raster.cells.assign(raster.size(), Cell::kSolid);
    looks.assign(raster.size(), CellLook(0, 0, 0, 1));
    for (size_t i = 0; i < raster.size(); ++i) {
      const size_t x = i % 64, y = i / 64;
      looks[i][0] = colour(y, period);
      if (x >= 22 && x < 42 && y >= 22 && y < 42) {
        raster.cells[i] = Cell::kHole;
        looks[i].setZero();
      }
    }
  }
  static double colour(size_t y, size_t period) { return y % period < period / 2 ? 1 : 0; }
};

TEST(PatchQuilt, CopiesGroundIntoEveryCellOfAHole) {
  const Striped striped(8);
  const auto sources = quiltSources(striped.raster, striped.looks, {});
  size_t fitting = 0;
  for (size_t i = 0; i < sources.size(); ++i) {
    if (striped.raster.cells[i] != Cell::kHole) {
      ASSERT_EQ(sources[i], UINT32_MAX);
      continue;
    }
    ASSERT_LT(sources[i], striped.raster.size());
    ASSERT_EQ(striped.raster.cells[sources[i]], Cell::kSolid);
    fitting += Striped::colour(sources[i] / 64, 8) == Striped::colour(i / 64, 8) ? 1 : 0;
  }
  // The stripes go on through the hole: chance would give half of them.
  EXPECT_GT(fitting, 380u);
}

TEST(PatchQuilt, CopiesNeighboursTogether) {
  const Striped striped(8);
  const auto sources = quiltSources(striped.raster, striped.looks, {});
  size_t together = 0, pairs = 0;
  for (size_t i = 0; i + 1 < sources.size(); ++i) {
    if (sources[i] == UINT32_MAX || sources[i + 1] == UINT32_MAX) continue;
    ++pairs;
    together += sources[i + 1] == sources[i] + 1 ? 1 : 0;
  }
  EXPECT_GT(together * 10, pairs * 8);
}

TEST(PatchQuilt, WithoutGroundCopiesNothing) {
  Striped striped(8);
  std::ranges::fill(striped.raster.cells, Cell::kHole);
  const auto sources = quiltSources(striped.raster, striped.looks, {});
  EXPECT_TRUE(std::ranges::all_of(sources, [](uint32_t s) { return s == UINT32_MAX; }));
}

TEST(HoleFilling, StopsWhenCancelled) {
  SplatCloud cloud;
  cloud.resize(1000);
  for (size_t i = 0; i < 1000; ++i) {
    cloud.positions[i * 3] = static_cast<float>(i % 32);
    cloud.positions[i * 3 + 1] = static_cast<float>(i / 32);
    cloud.rotations[i * 4] = 1;
  }
  std::vector<uint8_t> removed(1000, 0);
  removed[500] = 1;
  Progress progress;
  progress.cancel();
  FillReport report;
  try {
    holesFilled(cloud, removed, {}, report, &progress);
    FAIL() << "work went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

}  // namespace
}  // namespace stipple
