#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "adapt_meshes.h"
#include "base/parallel.h"
#include "base/random.h"
#include "mesh/adapt/complexity.h"
#include "mesh/adapt/density_energy.h"
#include "mesh/adapt/diffusion.h"

namespace stipple {
namespace {

std::vector<Vec3d> gradientOf(const MeshLinks& links, const std::vector<Vec3d>& positions,
                              const VertexLengths& lengths, const std::vector<double>& goals) {
  std::vector<Vec3d> gradient(positions.size(), Vec3d::Zero());
  addDensityGradient(links, positions, lengths, goals, 1.0, gradient);
  return gradient;
}

/// The energy where goals and mean are constants, as the forces take them.
double energyAt(const MeshLinks& links, const std::vector<Vec3d>& positions, double mean,
                const std::vector<double>& goals) {
  VertexLengths lengths = vertexLengths(links, positions);
  lengths.mean = mean;
  return densityEnergy(lengths, goals);
}

AdaptShape shaken(AdaptShape shape, double by) {
  for (size_t v = 0; v < shape.positions.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const uint64_t index = v * 3 + static_cast<uint64_t>(axis);
      shape.positions[v][axis] +=
          by * (2 * unitDouble(keyedBits(3, RandomUse::kThinning, index)) - 1);
    }
  }
  return shape;
}

// The numbers of the tetrahedron were worked out apart from this code, by finite differences of the
// equations; they have eight digits.
constexpr double kDigits = 6e-9;

TEST(DensityEnergy, GivesTheKnownNumbersOfATetrahedron) {
  const AdaptShape shape = tetrahedron();
  const MeshLinks links(4, shape.triangles);
  const VertexLengths lengths = vertexLengths(links, shape.positions);
  EXPECT_NEAR(lengths.lengths[0], 1.41421356, kDigits);
  for (size_t v = 1; v < 4; ++v) EXPECT_NEAR(lengths.lengths[v], 1.13807119, kDigits);
  EXPECT_NEAR(lengths.mean, 1.20710678, kDigits);
  const std::vector<double> goals(4, lengths.mean);
  EXPECT_NEAR(densityEnergy(lengths, goals), 0.0118446353, kDigits);
  const auto gradient = gradientOf(links, shape.positions, lengths, goals);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(gradient[0][axis], 0.01906365, kDigits);
    for (int v = 0; v < 3; ++v) {
      EXPECT_NEAR(gradient[static_cast<size_t>(v) + 1][axis], v == axis ? 0.00789642 : -0.01348004,
                  kDigits);
    }
  }
}

TEST(Complexity, GivesTheKnownNumbersOfATetrahedron) {
  const AdaptShape shape = tetrahedron();
  const MeshLinks links(4, shape.triangles);
  const VertexLengths lengths = vertexLengths(links, shape.positions);
  std::vector<Vec3d> bends(4);
  laplacian(links, shape.positions, bends);
  EXPECT_NEAR(bends[0].norm() / lengths.mean, 1.43487787, kDigits);
  EXPECT_NEAR(bends[1].norm() / lengths.mean, 2.74758194, kDigits);
  const Complexity complexity(links);
  const auto values = complexity.values(shape.positions, lengths);
  EXPECT_NEAR(values[0], 0.99674456, kDigits);
  EXPECT_NEAR(values[1], 1.00108515, kDigits);
  const auto goals = complexity.goals(shape.positions, lengths);
  EXPECT_NEAR(goals[0], 1.41421356, kDigits);
  EXPECT_NEAR(goals[3], 1.13683755, kDigits);
  EXPECT_NEAR(densityEnergy(lengths, goals), 9.45559e-7, 1e-12);
}

TEST(DensityEnergy, HasTheForcesOfItsFiniteDifferences) {
  for (const AdaptShape& shape : {shaken(sphere(2), 0.1), shaken(bumpySheet(6, 0.2), 0.05)}) {
    const MeshLinks links(shape.positions.size(), shape.triangles);
    const VertexLengths lengths = vertexLengths(links, shape.positions);
    const Complexity complexity(links);
    const std::vector<double> even(shape.positions.size(), lengths.mean);
    for (const auto& goals : {even, complexity.goals(shape.positions, lengths)}) {
      const auto gradient = gradientOf(links, shape.positions, lengths, goals);
      double largest = 0;
      for (const Vec3d& g : gradient) largest = std::max(largest, g.norm());
      ASSERT_GT(largest, 0);
      // Central differences are off by eps^2 of the third derivative, and by rounding over eps:
      // both are some 1e-10 of the energy here.
      constexpr double kEps = 1e-5;
      std::vector<Vec3d> moved = shape.positions;
      for (size_t v = 0; v < moved.size(); ++v) {
        for (int axis = 0; axis < 3; ++axis) {
          moved[v][axis] = shape.positions[v][axis] + kEps;
          const double above = energyAt(links, moved, lengths.mean, goals);
          moved[v][axis] = shape.positions[v][axis] - kEps;
          const double below = energyAt(links, moved, lengths.mean, goals);
          moved[v][axis] = shape.positions[v][axis];
          EXPECT_NEAR(gradient[v][axis], (above - below) / (2 * kEps), 1e-6 * largest);
        }
      }
    }
  }
}

TEST(DensityEnergy, NeitherPushesNorTurnsTheWhole) {
  const AdaptShape shape = shaken(sphere(3), 0.05);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const VertexLengths lengths = vertexLengths(links, shape.positions);
  const auto gradient = gradientOf(links, shape.positions, lengths,
                                   std::vector<double>(shape.positions.size(), lengths.mean));
  Vec3d force = Vec3d::Zero(), turn = Vec3d::Zero();
  for (size_t v = 0; v < gradient.size(); ++v) {
    force += gradient[v];
    const Vec3d &p = shape.positions[v], &g = gradient[v];
    turn += Vec3d(p[1] * g[2] - p[2] * g[1], p[2] * g[0] - p[0] * g[2], p[0] * g[1] - p[1] * g[0]);
  }
  EXPECT_LT(force.norm(), 1e-14);
  EXPECT_LT(turn.norm(), 1e-14);
}

TEST(DensityEnergy, StaysFiniteWhereFacesHaveNoArea) {
  AdaptShape shape = sphere(2);
  for (size_t corner = 1; corner < 3; ++corner) {
    shape.positions[shape.triangles[corner]] = shape.positions[shape.triangles[0]];
  }
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const VertexLengths lengths = vertexLengths(links, shape.positions);
  const Complexity complexity(links);
  for (const Vec3d& g :
       gradientOf(links, shape.positions, lengths, complexity.goals(shape.positions, lengths))) {
    EXPECT_TRUE(g.allFinite());
  }
  // All vertices in one place.
  const std::vector<Vec3d> nowhere(shape.positions.size(), Vec3d(1, 2, 3));
  const VertexLengths none = vertexLengths(links, nowhere);
  const auto goals = complexity.goals(nowhere, none);
  EXPECT_EQ(densityEnergy(none, goals), 0);
  for (const Vec3d& g : gradientOf(links, nowhere, none, goals)) EXPECT_EQ(g, Vec3d(0, 0, 0));
}

TEST(Complexity, AsksNothingToBecomeShorterThanALeastLength) {
  const AdaptShape shape = bumpySheet(20, 0.3);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const VertexLengths lengths = vertexLengths(links, shape.positions);
  const Complexity complexity(links);
  const auto free = complexity.goals(shape.positions, lengths);
  const auto held = complexity.goals(shape.positions, lengths, 0.5);
  size_t held_count = 0;
  for (size_t v = 0; v < free.size(); ++v) {
    // What is shorter already stays as it is.
    const double least = std::min(0.5 * lengths.mean, lengths.lengths[v]);
    EXPECT_EQ(held[v], std::max(free[v], least));
    held_count += free[v] < least ? 1 : 0;
  }
  EXPECT_GT(held_count, 5u);
}

TEST(Complexity, DoesNotTakeBordersForDetail) {
  // Two sheets far apart, the second one with a hole: three border loops.
  AdaptShape shape = bumpySheet(20, 0.3);
  const AdaptShape second = bumpySheet(20, 0.0);
  const auto first_count = static_cast<uint32_t>(shape.positions.size());
  for (const Vec3d& p : second.positions) shape.positions.push_back(p + Vec3d(5, 0, 0));
  for (size_t corner = 0; corner < second.triangles.size(); ++corner) {
    const size_t t = corner / 3;
    if (t < 300 || t > 303) shape.triangles.push_back(second.triangles[corner] + first_count);
  }
  const MeshLinks links(shape.positions.size(), shape.triangles);
  size_t borders = 0;
  for (size_t v = 0; v < links.vertexCount(); ++v) borders += links.isBorder(v) ? 1 : 0;
  EXPECT_GE(borders, 2 * 80 + 6);
  const Complexity complexity(links);
  const auto values = complexity.values(shape.positions, vertexLengths(links, shape.positions));
  const auto at = [&](double u, double v, size_t offset) {
    return values[offset + static_cast<size_t>(std::lround(v * 20) * 21 + std::lround(u * 20))];
  };
  EXPECT_GT(at(0.3, 0.3, 0), 5);
  for (size_t v = first_count; v < values.size(); ++v) EXPECT_LT(values[v], 1e-3);
  for (const double along : {0.0, 0.5, 1.0}) EXPECT_LT(at(1.0, along, 0), 0.1);
}

TEST(Complexity, IsTheSameEverywhereOnAPlaneAndAloneWhereSheetsMeet) {
  AdaptShape shape = bumpySheet(5, 0.0);
  {
    const MeshLinks links(shape.positions.size(), shape.triangles);
    const VertexLengths lengths = vertexLengths(links, shape.positions);
    EXPECT_EQ(Complexity(links).goals(shape.positions, lengths), lengths.lengths);
  }
  // A fin on an edge inside: its two ends are borders of a kind.
  const uint32_t a = 14, b = 15;
  shape.positions.emplace_back(0.5, 0.4, 1.0);
  shape.triangles.insert(shape.triangles.end(), {a, b, 36});
  const MeshLinks links(shape.positions.size(), shape.triangles);
  EXPECT_TRUE(links.isBorder(a) && links.isBorder(b));
  EXPECT_FALSE(links.isBorder(21));
}

TEST(Diffusion, SolvesWhatItMultiplies) {
  const AdaptShape shape = sphere(4);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const Diffusion diffusion(links, 1.0, 10.0);
  std::vector<Vec3d> values = shape.positions;
  diffusion.multiply(values);
  EXPECT_GT((values[0] - shape.positions[0]).norm(), 0.01);
  diffusion.solve(std::span<Vec3d>(values));
  // The condition number is 1 + 2 * 10 * 6 at most.
  for (size_t v = 0; v < values.size(); ++v) {
    EXPECT_LT((values[v] - shape.positions[v]).norm(), 1e-12);
  }
}

TEST(DensityEnergy, DoesNotDependOnTheNumberOfThreads) {
  const AdaptShape shape = shaken(sphere(5), 0.01);
  const MeshLinks links(shape.positions.size(), shape.triangles);
  const Complexity complexity(links);
  std::vector<Vec3d> first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    withThreads(threads, [&] {
      const VertexLengths lengths = vertexLengths(links, shape.positions);
      const auto gradient =
          gradientOf(links, shape.positions, lengths, complexity.goals(shape.positions, lengths));
      if (first.empty()) first = gradient;
      EXPECT_EQ(gradient, first);
    });
  }
}

}  // namespace
}  // namespace stipple
