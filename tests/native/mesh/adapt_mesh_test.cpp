#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "adapt_meshes.h"
#include "base/error.h"
#include "base/parallel.h"
#include "mesh/adapt/merged_vertices.h"
#include "mesh/adapt/mesh_adapter.h"

namespace stipple {
namespace {

/// Largest over smallest vertex length.
double spreadOf(const MeshLinks& links, std::span<const Vec3d> positions) {
  const auto lengths = vertexLengths(links, positions).lengths;
  const auto [low, high] = std::minmax_element(lengths.begin(), lengths.end());
  return *high / *low;
}

/// Pulls every vertex to the unit sphere, along the ray to it.
std::vector<Vec3d> pullToSphere(std::span<const Vec3d> positions) {
  std::vector<Vec3d> gradient;
  for (const Vec3d& p : positions) {
    gradient.push_back(2.0 / static_cast<double>(positions.size()) * (p - p.normalized()));
  }
  return gradient;
}

/// A sphere whose vertices crowd at one pole.
AdaptShape crowdedSphere(int splits) {
  AdaptShape shape = sphere(splits);
  for (Vec3d& p : shape.positions) p = (p + Vec3d(0, 0, 0.6)).normalized();
  return shape;
}

std::vector<Vec3d> adapted(const AdaptShape& shape, const MeshAdapterOptions& options) {
  const MeshLinks links(shape.positions.size(), shape.triangles);
  MeshAdapter adapter(links, shape.positions, options);
  for (uint32_t step = 0; step < options.steps; ++step) {
    std::vector<Vec3d> gradient = pullToSphere(adapter.positions());
    adapter.step(gradient);
  }
  return {adapter.positions().begin(), adapter.positions().end()};
}

TEST(AdamUniform, TakesTheSameStepAsItsEquations) {
  AdamUniform optimiser(2, 0.1);
  std::vector<Vec3d> values = {{0, 0, 0}, {1, 1, 1}};
  const std::vector<Vec3d> gradient = {{3, 0, 4}, {0, 2, 0}};
  // After one step both moments are the gradient and its square, and 4 is the largest root.
  optimiser.step(values, gradient);
  EXPECT_NEAR(values[0][0], -0.1 * 3 / 4, 1e-9);
  EXPECT_NEAR(values[0][2], -0.1, 1e-9);
  EXPECT_NEAR(values[1][1], 1 - 0.1 * 2 / 4, 1e-9);
  // First moment (0.9 * 0.1 * g) / 0.19, second (0.999 * 0.001 * g^2) / 0.001999.
  const double before = values[1][1];
  const std::vector<Vec3d> none = {{0, 0, 0}, {0, 0, 0}};
  optimiser.step(values, none);
  const double largest = std::sqrt(0.999e-3 * 16 / (1 - 0.999 * 0.999));
  EXPECT_NEAR(values[1][1], before - 0.1 * (0.09 * 2 / 0.19) / largest, 1e-9);
}

TEST(AdamUniform, StandsStillWithoutAGradient) {
  AdamUniform optimiser(1, 0.1);
  std::vector<Vec3d> values = {{1, 2, 3}};
  optimiser.step(values, std::vector<Vec3d>{Vec3d::Zero()});
  EXPECT_EQ(values[0], Vec3d(1, 2, 3));
}

TEST(MeshAdapter, EvensOutACrowdedSphere) {
  const AdaptShape shape = crowdedSphere(4);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  MeshAdapterOptions options;
  options.steps = 200;
  options.density = MeshDensity::kOff;
  const double off = spreadOf(links, adapted(shape, options));
  options.density = MeshDensity::kUniform;
  const auto even = adapted(shape, options);
  EXPECT_LT(spreadOf(links, even), 0.6 * off);
  // The optimiser goes on in steps of 0.05 at most, and swings about the end by less.
  for (const Vec3d& p : even) EXPECT_NEAR(p.norm(), 1, 0.05);
}

TEST(MeshAdapter, HasThreePhases) {
  MeshAdapterOptions options;
  EXPECT_EQ(densityPhase(options, 159).goal, MeshDensity::kUniform);
  EXPECT_EQ(densityPhase(options, 159).weight, 1.5);
  EXPECT_EQ(densityPhase(options, 160).goal, MeshDensity::kAdaptive);
  EXPECT_EQ(densityPhase(options, 319).weight, 4.5);
  EXPECT_EQ(densityPhase(options, 320).goal, MeshDensity::kOff);
  options.density = MeshDensity::kUniform;
  EXPECT_EQ(densityPhase(options, 319).goal, MeshDensity::kUniform);
  EXPECT_EQ(densityPhase(options, 320).goal, MeshDensity::kOff);
  options.density = MeshDensity::kOff;
  EXPECT_EQ(densityPhase(options, 0).goal, MeshDensity::kOff);
}

TEST(MeshAdapter, TakesShorterStepsTowardsTheEnd) {
  MeshAdapterOptions options;
  EXPECT_EQ(stepShare(options, 0), 1.0);
  EXPECT_EQ(stepShare(options, 720), 1.0);
  EXPECT_NEAR(stepShare(options, 760), 0.55, 1e-12);  // half the way from 1 to 0.1
  EXPECT_NEAR(stepShare(options, 800), 0.1, 1e-12);
  EXPECT_NEAR(stepShare(options, 900), 0.1, 1e-12);  // who goes on does so by small steps
  options.steps = 1;
  EXPECT_EQ(stepShare(options, 0), 1.0);
  options.last_share = 1.5;
  EXPECT_THROW(validate(options), Error);
}

TEST(MeshAdapter, IsNotHeldUpByADensityThatHasGone) {
  const AdaptShape shape = sphere(2);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  MeshAdapterOptions options;
  options.steps = 40;
  options.density = MeshDensity::kUniform;
  options.strength = 1000;
  MeshAdapter adapter(links, shape.positions, options);
  std::vector<Vec3d> gradient(shape.positions.size());
  for (uint32_t step = 0; step < 16; ++step) {
    std::fill(gradient.begin(), gradient.end(), Vec3d::Zero());
    adapter.step(gradient);
  }
  const Vec3d before = adapter.positions()[0];
  std::fill(gradient.begin(), gradient.end(), Vec3d(1e-6, 0, 0));
  adapter.step(gradient);
  // Equal gradients pass M^-1 as they are, and the first step of an optimiser is its step size,
  // apart from the 1e-8 that it adds to a gradient of 1e-6.
  EXPECT_NEAR(adapter.positions()[0][0], before[0] - 0.05, 1e-3);
}

TEST(MeshAdapter, GivesTheSameShapeForAnyNumberOfThreads) {
  const AdaptShape shape = crowdedSphere(4);
  MeshAdapterOptions options;
  options.steps = 30;
  std::vector<Vec3d> first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    withThreads(threads, [&] {
      const auto made = adapted(shape, options);
      if (first.empty()) first = made;
      EXPECT_EQ(made, first);
    });
  }
}

TEST(MeshAdapter, KeepsFinitePositionsOnFacesWithoutArea) {
  AdaptShape shape = sphere(3);
  for (size_t corner = 1; corner < 3; ++corner) {
    shape.positions[shape.triangles[corner]] = shape.positions[shape.triangles[0]];
  }
  MeshAdapterOptions options;
  options.steps = 60;
  for (const Vec3d& p : adapted(shape, options)) {
    EXPECT_TRUE(p.allFinite());
    EXPECT_LT(p.norm(), 2);
  }
}

TEST(MeshAdapter, MovesIslandsWithoutEachOther) {
  AdaptShape shape = sphere(2);
  const auto count = static_cast<uint32_t>(shape.positions.size());
  const AdaptShape other = shape;
  for (const Vec3d& p : other.positions) shape.positions.push_back(p);
  for (const uint32_t v : other.triangles) shape.triangles.push_back(v + count);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  MeshAdapterOptions options;
  options.density = MeshDensity::kOff;
  MeshAdapter adapter(links, shape.positions, options);
  std::vector<Vec3d> gradient(shape.positions.size(), Vec3d::Zero());
  gradient[0] = Vec3d(1, 0, 0);
  adapter.step(gradient);
  EXPECT_GT((adapter.positions()[1] - shape.positions[1]).norm(), 1e-6);
  for (size_t v = count; v < shape.positions.size(); ++v) {
    EXPECT_LT((adapter.positions()[v] - shape.positions[v]).norm(), 1e-14);
  }
}

TEST(MeshAdapter, SmoothsUnderALaplacianPenalty) {
  const AdaptShape shape = crowdedSphere(3);
  MeshAdapterOptions options;
  options.steps = 100;
  options.density = MeshDensity::kOff;
  double before = 0, after = 0;
  for (const Vec3d& p : adapted(shape, options)) before += p.norm();
  options.laplacian = 1;
  for (const Vec3d& p : adapted(shape, options)) after += p.norm();
  // The penalty is least where the sphere has become a point.
  EXPECT_LT(after, 0.98 * before);
}

TEST(MeshAdapter, RefusesOptionsOutsideTheirRange) {
  const auto messageOf = [](const auto& change) {
    MeshAdapterOptions options;
    change(options);
    try {
      validate(options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(messageOf([](auto&) {}), "");
  EXPECT_EQ(messageOf([](auto& o) { o.strength = -1; }),
            "strength of the density is -1.000000; 0 to 1000000 is allowed");
  EXPECT_NE(messageOf([](auto& o) { o.smoothness = std::numeric_limits<double>::quiet_NaN(); }),
            "");
  EXPECT_EQ(messageOf([](auto& o) { o.step_size = 0; }),
            "step size is 0.000000; more than 0 and at most 10 is allowed");
  EXPECT_EQ(messageOf([](auto& o) { o.steps = 0; }), "steps are 0; 1 to 1000000 are allowed");
}

TEST(MergedVertices, JoinsSeamsAndMapsBack) {
  // A quad whose triangles have no vertex in common, a loose vertex, a loose duplicate, and a
  // triangle of two places.
  const std::vector<float> positions = {0, 0, 0, 1,     0, 0, 1, 1, 0,  //
                                        0, 0, 0, 1,     1, 0, 0, 1, 0,  //
                                        9, 9, 9, -0.0f, 0, 0};
  const std::vector<uint32_t> triangles = {0, 1, 2, 3, 4, 5, 0, 3, 1};
  const MergedVertices merged = mergeVertices(positions, triangles);
  EXPECT_EQ(merged.positions.size(), 4u);
  EXPECT_EQ(merged.place_of, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3, kLooseVertex, 0}));
  EXPECT_EQ(merged.triangles, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
}

}  // namespace
}  // namespace stipple
