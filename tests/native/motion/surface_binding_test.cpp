#include "motion/surface_binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "data/clouds/cloud_transform.h"
#include "math/covariance.h"
#include "math/quaternion.h"
#include "motion/triangle_motion.h"

namespace stipple {
namespace {

using testing::HasSubstr;

float drawn(uint64_t stream, uint64_t index, float from, float to) {
  return from + (to - from) * unitFloat(keyedBits(stream, RandomUse::kThinning, index));
}

struct Grid {
  std::vector<float> positions;
  std::vector<uint32_t> triangles;
};

/// A wavy square of 2 n^2 triangles over [-1,1]^2.
Grid wavyGrid(uint32_t n) {
  Grid grid;
  for (uint32_t i = 0; i <= n; ++i) {
    for (uint32_t j = 0; j <= n; ++j) {
      const float x = 2.0f * static_cast<float>(i) / static_cast<float>(n) - 1;
      const float y = 2.0f * static_cast<float>(j) / static_cast<float>(n) - 1;
      grid.positions.insert(grid.positions.end(), {x, y, 0.2f * std::sin(3 * x) * std::cos(2 * y)});
    }
  }
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t j = 0; j < n; ++j) {
      const uint32_t at = i * (n + 1) + j;
      grid.triangles.insert(grid.triangles.end(),
                            {at, at + n + 1, at + 1, at + 1, at + n + 1, at + n + 2});
    }
  }
  return grid;
}

SplatCloud splatsAt(const std::vector<float>& positions, int degree = 1) {
  SplatCloud cloud;
  cloud.sh_degree = degree;
  const size_t count = positions.size() / 3;
  cloud.resize(count);
  cloud.positions = positions;
  for (size_t i = 0; i < 4 * count; ++i) cloud.rotations[i] = drawn(1, i, -1, 1);
  normaliseRotations(cloud);
  for (size_t i = 0; i < 3 * count; ++i) cloud.scales[i] = drawn(2, i, 0.001f, 0.03f);
  for (size_t i = 0; i < count; ++i) cloud.opacities[i] = drawn(3, i, 0, 1);
  for (size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] = drawn(4, i, -1, 1);
  return cloud;
}

/// Places about the grid, some of them far from it.
SplatCloud splatsAround(size_t count) {
  std::vector<float> positions;
  for (size_t i = 0; i < 3 * count; ++i) positions.push_back(drawn(5, i, -1.3f, 1.3f));
  return splatsAt(positions);
}

std::vector<float> mapped(const std::vector<float>& positions,
                          const std::function<Vec3d(const Vec3d&)>& map) {
  std::vector<float> result;
  for (size_t i = 0; i < positions.size(); i += 3) {
    const Vec3d at = map({positions[i], positions[i + 1], positions[i + 2]});
    for (int axis = 0; axis < 3; ++axis) result.push_back(static_cast<float>(at[axis]));
  }
  return result;
}

Mat3d covarianceAt(const SplatCloud& cloud, size_t row) {
  const Mat3d axes = rotationFromQuaternion<double>(&cloud.rotations[4 * row]);
  const Vec3d lengths(cloud.scales[3 * row], cloud.scales[3 * row + 1], cloud.scales[3 * row + 2]);
  return axes * lengths.cwiseAbs2().asDiagonal() * axes.transpose();
}

class BothReaches : public testing::TestWithParam<BindingReach> {};

INSTANTIATE_TEST_SUITE_P(Reach, BothReaches,
                         testing::Values(BindingReach::kSurface, BindingReach::kAround));

TEST_P(BothReaches, AMeshThatMovesAsOneCarriesSplatsLikeAnObject) {
  const Grid grid = wavyGrid(12);
  const SplatCloud cloud = splatsAround(300);
  const SurfaceBinding binding =
      bindToSurface(cloud.positions, grid.positions, grid.triangles, GetParam());
  validate(binding, cloud.size(), "the binding");
  Mat4d matrix = Mat4d::Identity();
  const float turn[4] = {0.4f, 0.5f, -0.6f, 0.3f};
  matrix.topLeftCorner<3, 3>() = 1.7 * rotationFromQuaternion<double>(turn);
  matrix.topRightCorner<3, 1>() = Vec3d(0.3, -2, 1);
  const auto deformed = mapped(grid.positions, [&](const Vec3d& p) {
    return Vec3d(matrix.topLeftCorner<3, 3>() * p + matrix.topRightCorner<3, 1>());
  });
  const SplatCloud carried = carriedSplats(cloud, binding, deformed);
  const SplatCloud wanted = transformed(cloud, matrix);
  // Vertices are rounded to float32 of numbers up to 4, edges are 0.17 long, and places up to 2.3
  // beside them: 2.4e-7 / 0.17 * 2.3, a few times.
  for (size_t i = 0; i < carried.positions.size(); ++i) {
    EXPECT_NEAR(carried.positions[i], wanted.positions[i], 2e-5f);
  }
  for (size_t row = 0; row < cloud.size(); ++row) {
    const Mat3d difference = covarianceAt(carried, row) - covarianceAt(wanted, row);
    EXPECT_LE(difference.norm(), 2e-5 * covarianceAt(wanted, row).norm());
  }
  for (size_t i = 0; i < carried.sh.size(); ++i) EXPECT_NEAR(carried.sh[i], wanted.sh[i], 2e-5f);
  EXPECT_EQ(carried.opacities, cloud.opacities);
}

TEST_P(BothReaches, AtRestNothingMoves) {
  const Grid grid = wavyGrid(9);
  const SplatCloud cloud = splatsAround(200);
  const SurfaceBinding binding =
      bindToSurface(cloud.positions, grid.positions, grid.triangles, GetParam());
  const SplatCloud carried = carriedSplats(cloud, binding, grid.positions);
  for (size_t i = 0; i < carried.positions.size(); ++i) {
    EXPECT_NEAR(carried.positions[i], cloud.positions[i], 2e-6f);
  }
  for (size_t i = 0; i < carried.scales.size(); ++i) {
    EXPECT_NEAR(carried.scales[i], cloud.scales[i], 2e-6f * cloud.scales[i] + 1e-9f);
  }
}

TEST_P(BothReaches, HasTheSameBitsForAnyNumberOfThreads) {
  const Grid grid = wavyGrid(20);
  const SplatCloud cloud = splatsAround(5000);
  const auto deformed = mapped(
      grid.positions, [](const Vec3d& p) { return Vec3d(p[0], p[1] + p[0] * p[0], p[2] * 2); });
  SurfaceBinding one, many;
  SplatCloud carried_one, carried_many;
  withThreads(1, [&] {
    one = bindToSurface(cloud.positions, grid.positions, grid.triangles, GetParam());
    carried_one = carriedSplats(cloud, one, deformed);
  });
  withThreads(2, [&] {
    many = bindToSurface(cloud.positions, grid.positions, grid.triangles, GetParam());
    carried_many = carriedSplats(cloud, many, deformed);
  });
  EXPECT_EQ(one.bound, many.bound);
  EXPECT_EQ(one.weights, many.weights);
  EXPECT_EQ(carried_one.positions, carried_many.positions);
  EXPECT_EQ(carried_one.rotations, carried_many.rotations);
  EXPECT_EQ(carried_one.scales, carried_many.scales);
  EXPECT_EQ(carried_one.sh, carried_many.sh);
}

TEST(SurfaceBinding, SplatsOnTheMeshKeepTheirPlacesOnIt) {
  const Grid grid = wavyGrid(10);
  const size_t count = 500, triangle_count = grid.triangles.size() / 3;
  std::vector<float> positions;
  std::vector<std::array<double, 3>> weights;
  const auto placeOn = [&](const std::vector<float>& vertices, size_t i) {
    const uint32_t* corners = &grid.triangles[3 * (i * 7 % triangle_count)];
    Vec3d at = Vec3d::Zero();
    for (size_t c = 0; c < 3; ++c) {
      const float* vertex = &vertices[size_t{3} * corners[c]];
      at += weights[i][c] * Vec3d(vertex[0], vertex[1], vertex[2]);
    }
    return at;
  };
  for (size_t i = 0; i < count; ++i) {
    const double a = drawn(7, i, 0.05f, 0.9f);
    const double b = double{drawn(8, i, 0.05f, 0.95f)} * (1 - a);
    weights.push_back({1 - a - b, a, b});
    const Vec3d at = placeOn(grid.positions, i);
    for (int axis = 0; axis < 3; ++axis) positions.push_back(static_cast<float>(at[axis]));
  }
  const SurfaceBinding binding =
      bindToSurface(positions, grid.positions, grid.triangles, BindingReach::kSurface);
  const auto deformed = mapped(grid.positions, [](const Vec3d& p) {
    return Vec3d(p[0] * std::cos(2 * p[1]), 3 * p[1], p[0] * std::sin(2 * p[1]) + p[2]);
  });
  const SplatCloud carried = carriedSplats(splatsAt(positions), binding, deformed);
  for (size_t i = 0; i < count; ++i) {
    const Vec3d wanted = placeOn(deformed, i);
    for (int axis = 0; axis < 3; ++axis) {
      // Places were rounded to float32 at rest and are stretched three times.
      EXPECT_NEAR(carried.positions[3 * i + static_cast<size_t>(axis)], wanted[axis], 2e-6);
    }
  }
}

TEST(SurfaceBinding, HeightAboveATriangleGrowsWithTheRootOfItsArea) {
  const std::vector<float> rest = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<float> deformed = {0, 0, 0, 4, 0, 0, 0, 1, 0};
  const std::vector<uint32_t> triangles = {0, 1, 2};
  const std::vector<float> positions = {0.25f, 0.25f, 0.5f};
  SplatCloud cloud = splatsAt(positions, 0);
  cloud.rotations = {1, 0, 0, 0};
  cloud.scales = {0.1f, 0.2f, 0.3f};
  const SurfaceBinding binding = bindToSurface(positions, rest, triangles, BindingReach::kSurface);
  const SplatCloud carried = carriedSplats(cloud, binding, deformed);
  EXPECT_NEAR(carried.positions[0], 1.0f, 1e-6f);
  EXPECT_NEAR(carried.positions[1], 0.25f, 1e-6f);
  EXPECT_NEAR(carried.positions[2], 1.0f, 1e-6f);
  EXPECT_NEAR(carried.scales[0], 0.4f, 1e-6f);
  EXPECT_NEAR(carried.scales[1], 0.2f, 1e-6f);
  EXPECT_NEAR(carried.scales[2], 0.6f, 1e-6f);
}

TEST(SurfaceBinding, ShapesStayWithinTheBoundsOfStretch) {
  const std::vector<float> rest = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<float> deformed = {0, 0, 0, 300, 0, 0, 0, 1e-4f, 0};
  const std::vector<uint32_t> triangles = {0, 1, 2};
  const std::vector<float> positions = {0.5f, 0.25f, 0};
  SplatCloud cloud = splatsAt(positions, 0);
  cloud.rotations = {1, 0, 0, 0};
  cloud.scales = {0.1f, 0.1f, 0.1f};
  const SurfaceBinding binding = bindToSurface(positions, rest, triangles, BindingReach::kSurface);
  const SplatCloud carried = carriedSplats(cloud, binding, deformed);
  EXPECT_NEAR(carried.positions[0], 150.0f, 1e-4f);  // places follow all the way
  EXPECT_NEAR(carried.scales[0], 1.0f, 1e-6f);
  EXPECT_NEAR(carried.scales[1], 0.01f, 1e-7f);
}

TEST(SurfaceBinding, AroundAMeshPlacesChangeWithoutJumps) {
  const Grid grid = wavyGrid(8);
  constexpr size_t kSteps = 4000;
  std::vector<float> positions;
  for (size_t i = 0; i < kSteps; ++i) {
    const float x = 2.4f * static_cast<float>(i) / kSteps - 1.2f;
    positions.insert(positions.end(), {x, 0.3f * x, 0.35f});
  }
  const auto deformed = mapped(grid.positions, [](const Vec3d& p) {
    return Vec3d(p[0] * std::cos(p[1]), p[1], p[2] + p[0] * std::sin(p[1]));
  });
  const auto largestStep = [&](BindingReach reach) {
    const SurfaceBinding binding = bindToSurface(positions, grid.positions, grid.triangles, reach);
    const SplatCloud carried = carriedSplats(splatsAt(positions), binding, deformed);
    double largest = 0;
    for (size_t i = 3; i < carried.positions.size(); i += 3) {
      Vec3d step;
      for (size_t axis = 0; axis < 3; ++axis) {
        step[static_cast<Eigen::Index>(axis)] =
            static_cast<double>(carried.positions[i + axis]) -
            static_cast<double>(carried.positions[i + axis - 3]);
      }
      largest = std::max(largest, step.norm());
    }
    return largest;
  };
  // Places are 0.00063 apart; weights that change as fast as triangles are large make it a few
  // times as much. Bound to one triangle each, places jump where triangles change.
  EXPECT_LT(largestStep(BindingReach::kAround), 0.005);
  EXPECT_GT(largestStep(BindingReach::kSurface), 0.005);
}

TEST(SurfaceBinding, TrianglesWithoutAreaAreNotFollowed) {
  // The nearest triangle is a line.
  const std::vector<float> rest = {0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 5, 0, 1, 5, 0, 0, 6, 0};
  const std::vector<uint32_t> triangles = {0, 1, 2, 3, 4, 5};
  const SurfaceBinding binding =
      bindToSurface(std::vector<float>{0.5f, 0, 0.1f}, rest, triangles, BindingReach::kSurface);
  EXPECT_EQ(binding.bound[0], 1u);
}

TEST(SurfaceBinding, TopologyIsOfVerticesAndTriangles) {
  const Grid grid = wavyGrid(3);
  const uint64_t hash = topologyOf(16, grid.triangles);
  EXPECT_EQ(hash, topologyOf(16, grid.triangles));
  EXPECT_NE(hash, topologyOf(17, grid.triangles));
  std::vector<uint32_t> other = grid.triangles;
  std::swap(other[0], other[1]);
  EXPECT_NE(hash, topologyOf(16, other));
}

std::string messageOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return error.what();
  }
  return "";
}

TEST(SurfaceBinding, RefusesMeshesAndBindingsThatDoNotHold) {
  const Grid grid = wavyGrid(2);
  const std::vector<float> positions = {0, 0, 0, 0.5f, 0.5f, 0};
  const auto bind = [&](const std::vector<float>& rest, const std::vector<uint32_t>& triangles) {
    return messageOf([&] { bindToSurface(positions, rest, triangles, BindingReach::kSurface); });
  };
  EXPECT_EQ(bind(grid.positions, grid.triangles), "");
  EXPECT_THAT(bind(grid.positions, {}), HasSubstr("no triangle with an area"));
  EXPECT_THAT(bind(grid.positions, {0, 1, 99}), HasSubstr("vertex 99 of 9"));
  std::vector<float> broken = grid.positions;
  broken[4] = std::numeric_limits<float>::infinity();
  EXPECT_THAT(bind(broken, grid.triangles), HasSubstr("not finite"));

  const SurfaceBinding binding =
      bindToSurface(positions, grid.positions, grid.triangles, BindingReach::kAround);
  const SplatCloud cloud = splatsAt(positions);
  EXPECT_THAT(messageOf([&] { validate(binding, 3, "the binding"); }),
              HasSubstr("the binding is of 2 splats"));
  SurfaceBinding other = binding;
  other.bound[0] = 8;
  EXPECT_THAT(messageOf([&] { validate(other, 2, "the binding"); }),
              HasSubstr("leads to triangle 8 of 8"));
  other = binding;
  other.weights[0] += 0.5f;
  EXPECT_THAT(messageOf([&] { validate(other, 2, "the binding"); }), HasSubstr("weight"));
  EXPECT_THAT(messageOf([&] { carriedSplats(cloud, binding, std::vector<float>(24)); }),
              HasSubstr("has 8 vertices; splats are bound to one of 9"));
  EXPECT_THAT(messageOf([&] { carriedSplats(cloud, binding, broken); }), HasSubstr("not finite"));
}

}  // namespace
}  // namespace stipple
