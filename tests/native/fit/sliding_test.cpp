#include "fit/registration/registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "fit/registration/even_sliding.h"
#include "fit/registration/sliding_surface.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt_meshes.h"

namespace stipple {
namespace {

/// The box from -1 to 1 with side x side squares on each face, which lie closer together towards
/// one corner.
AdaptShape unevenBox(int side) {
  AdaptShape made;
  std::map<std::array<int, 3>, uint32_t> known;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = known.emplace(at, static_cast<uint32_t>(made.positions.size()));
    if (is_new) {
      Vec3d p;
      for (int axis = 0; axis < 3; ++axis) {
        const double along = static_cast<double>(at[static_cast<size_t>(axis)]) / side;
        p[axis] = 2 * along * along - 1;
      }
      made.positions.push_back(p);
    }
    return entry->second;
  };
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const int end : {0, side}) {
      for (int i = 0; i < side; ++i) {
        for (int j = 0; j < side; ++j) {
          uint32_t corners[4];
          for (int corner = 0; corner < 4; ++corner) {
            std::array<int, 3> at;
            at[axis] = end;
            at[(axis + 1) % 3] = i + (corner == 1 || corner == 2);
            at[(axis + 2) % 3] = j + (corner >= 2);
            corners[corner] = vertex(at);
          }
          if (end == 0) std::swap(corners[1], corners[3]);
          made.triangles.insert(made.triangles.end(), {corners[0], corners[1], corners[2],
                                                       corners[0], corners[2], corners[3]});
        }
      }
    }
  }
  return made;
}

std::vector<Vec3d> placesOf(const TriMesh& mesh) {
  std::vector<Vec3d> places;
  for (size_t v = 0; v < mesh.vertexCount(); ++v) {
    places.push_back(Eigen::Map<const Vec3f>(&mesh.positions[v * 3]).cast<double>());
  }
  return places;
}

/// Standard deviation of values over their mean.
double deviationOf(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double value : values) sum += value;
  const double mean = sum / static_cast<double>(values.size());
  for (const double value : values) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(values.size())) / mean;
}

double deviationOfAreas(const TriMesh& mesh) {
  const std::vector<Vec3d> places = placesOf(mesh);
  std::vector<double> areas;
  for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
    areas.push_back(areaVector(mesh.triangles, places, t).norm());
  }
  return deviationOf(areas);
}

double deviationOfEdges(const TriMesh& mesh) {
  const std::vector<Vec3d> places = placesOf(mesh);
  std::vector<double> lengths;
  for (size_t corner = 0; corner < mesh.triangles.size(); ++corner) {
    const size_t next = corner / 3 * 3 + (corner + 1) % 3;
    lengths.push_back((places[mesh.triangles[corner]] - places[mesh.triangles[next]]).norm());
  }
  return deviationOf(lengths);
}

/// A ball whose one side was pulled out, as by the Grab brush.
AdaptShape pulledBall() {
  AdaptShape made = sphere(4);
  const Vec3d pull(0.84, -0.7, 0.868);
  for (Vec3d& p : made.positions) {
    const double near = std::max(0.0, (p.dot(pull.normalized()) - 0.6) / 0.4);
    p += pull * near * near;
  }
  return made;
}

/// Sum of the areas of triangles: folded ones count twice.
double areaOf(const TriMesh& mesh) {
  const std::vector<Vec3d> places = placesOf(mesh);
  double sum = 0;
  for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
    sum += 0.5 * areaVector(mesh.triangles, places, t).norm();
  }
  return sum;
}

RegistrationOptions quick(uint32_t steps) {
  RegistrationOptions options;
  options.adapter.steps = steps;
  options.adapter.density = MeshDensity::kUniform;
  options.report_count = 5000;
  options.lands_on_target = true;
  return options;
}

RegisteredMesh slideOnItself(const TriMesh& given, const RegistrationOptions& options) {
  return registerMesh(given, targetOfMesh(given, 4000, 1), options);
}

TEST(Sliding, ABoxKeepsItsEdgesAndCorners) {
  const AdaptShape box = unevenBox(10);
  const TriMesh given = meshOf(box);
  const RegisteredMesh made = slideOnItself(given, quick(48));
  EXPECT_EQ(made.mesh.triangles, given.triangles);
  // Even squares in both directions are what each face has room for.
  EXPECT_GT(deviationOfAreas(given), 0.8);
  EXPECT_LT(deviationOfAreas(made.mesh), 0.01);
  const auto planesAt = [](const float* p) {
    int planes = 0;
    for (int axis = 0; axis < 3; ++axis) planes += std::abs(std::abs(p[axis]) - 1.0f) < 1e-6f;
    return planes;
  };
  size_t moved = 0;
  for (size_t v = 0; v < given.vertexCount(); ++v) {
    const float *from = &given.positions[v * 3], *to = &made.mesh.positions[v * 3];
    EXPECT_GE(planesAt(to), planesAt(from)) << v;  // faces, edges and corners stay what they are
    EXPECT_GE(planesAt(to), 1) << v;
    moved += std::abs(from[0] - to[0]) + std::abs(from[1] - to[1]) + std::abs(from[2] - to[2]) > 0;
  }
  EXPECT_GT(moved, given.vertexCount() / 2);
  // The surface of the box: no edge is cut, no face folded.
  EXPECT_NEAR(areaOf(made.mesh), 24.0, 1e-4);
  EXPECT_LT(made.report.after.distance, 1e-6);
  RegisteredMesh alone;
  withThreads(1, [&] { alone = slideOnItself(given, quick(48)); });
  EXPECT_EQ(alone.mesh.positions, made.mesh.positions);
}

TEST(Sliding, WithoutSharpEdgesABoxIsCut) {
  RegistrationOptions options = quick(48);
  options.sharp_angle = 3.14;
  const TriMesh given = meshOf(unevenBox(10));
  // What the sharp angle is for: vertices leave the edges.
  EXPECT_LT(areaOf(slideOnItself(given, options).mesh), 23.9);
}

TEST(Sliding, ASheetKeepsItsBorderAndDetailGetsMore) {
  const AdaptShape sheet = bumpySheet(24, 0.3);
  const TriMesh given = meshOf(sheet);
  RegistrationOptions options = quick(48);
  options.adapter.density = MeshDensity::kAdaptive;
  const RegisteredMesh made = slideOnItself(given, options);
  const std::vector<Vec3d> places = placesOf(made.mesh);
  size_t before = 0, after = 0;
  for (size_t v = 0; v < places.size(); ++v) {
    const Vec3d& from = sheet.positions[v];
    const auto isNear = [](const Vec3d& p) { return std::hypot(p[0] - 0.3, p[1] - 0.3) < 0.15; };
    before += isNear(from);
    after += isNear(places[v]);
    for (int axis = 0; axis < 2; ++axis) {
      if (from[axis] == 0 || from[axis] == 1) {
        EXPECT_NEAR(places[v][axis], from[axis], 1e-6);
      }
    }
  }
  EXPECT_GT(after, before + before / 6);
}

TEST(Sliding, APulledBallBecomesEvenAndNothingIsTurnedOver) {
  const AdaptShape ball = pulledBall();
  const TriMesh given = meshOf(ball);
  const MeshLinks links(ball.positions.size(), ball.triangles);
  const SlidingSurface surface(links, ball.positions, 0.7);
  std::map<MeshDensity, double> distance;
  for (const MeshDensity density : {MeshDensity::kUniform, MeshDensity::kAdaptive}) {
    RegistrationOptions options = quick(48);
    options.adapter.density = density;
    const RegisteredMesh made = slideOnItself(given, options);
    EXPECT_LT(deviationOfAreas(made.mesh), 0.7 * deviationOfAreas(given));
    EXPECT_LT(deviationOfEdges(made.mesh), 0.65 * deviationOfEdges(given));
    const std::vector<uint8_t> turned = surface.turned(placesOf(made.mesh));
    EXPECT_EQ(std::count(turned.begin(), turned.end(), 1), 0);
    distance[density] = made.report.after.distance;
  }
  // What bends more has shorter edges, so that they cut less of it.
  EXPECT_LT(distance[MeshDensity::kAdaptive], distance[MeshDensity::kUniform]);
}

TEST(Sliding, ABadSpotLeavesTheRestEven) {
  AdaptShape ball = pulledBall();
  // Crumpled like paper on the far side: vertices that slide there turn something over.
  uint64_t drawn = 0;
  const auto random = [&] { return unitDouble(mixBits(++drawn)) - 0.5; };
  for (Vec3d& p : ball.positions) {
    const Vec3d away(random(), random(), random());
    if (p.normalized().dot(Vec3d(-0.84, 0.7, -0.868).normalized()) > 0.9) p += 0.3 * away;
  }
  const TriMesh given = meshOf(ball);
  RegistrationOptions options = quick(48);
  options.sharp_angle = 3.0;  // Nothing is held there.
  const RegisteredMesh made = slideOnItself(given, options);
  EXPECT_LT(deviationOfAreas(made.mesh), 0.75 * deviationOfAreas(given));
  const MeshLinks links(ball.positions.size(), ball.triangles);
  const SlidingSurface surface(links, ball.positions, options.sharp_angle);
  const std::vector<uint8_t> before = surface.turned(placesOf(given));
  const std::vector<uint8_t> after = surface.turned(placesOf(made.mesh));
  for (size_t t = 0; t < before.size(); ++t) EXPECT_LE(after[t], before[t]) << t;
}

TEST(Sliding, WhatIsEvenStaysAndDensityOffMovesNothing) {
  const TriMesh given = meshOf(sphere(3));
  RegistrationOptions options = quick(48);
  const double before = deviationOfAreas(given) + deviationOfEdges(given);
  const RegisteredMesh made = slideOnItself(given, options);
  EXPECT_LE(deviationOfAreas(made.mesh) + deviationOfEdges(made.mesh), before + 1e-6);
  options.adapter.density = MeshDensity::kOff;
  const RegisteredMesh still = slideOnItself(given, options);
  for (size_t i = 0; i < given.positions.size(); ++i) {
    EXPECT_NEAR(still.mesh.positions[i], given.positions[i], 1e-6);
  }
  EXPECT_EQ(still.report.step_count, 0u);
}

TEST(Sliding, AWatchEndsItWithTheMostEvenShapeSoFar) {
  const TriMesh given = meshOf(pulledBall());
  RegistrationWatch watch;
  watch.finish();
  const RegisteredMesh made =
      registerMesh(given, targetOfMesh(given, 4000, 1), quick(48), nullptr, &watch);
  EXPECT_EQ(made.report.step_count, 0u);
  EXPECT_LE(deviationOfAreas(made.mesh), deviationOfAreas(given) + 1e-6);
}

TEST(Sliding, LandmarksAreRefused) {
  RegistrationOptions options = quick(5);
  options.landmarks = {{0, Vec3d(1, 0, 0)}};
  const TriMesh given = meshOf(sphere(2));
  EXPECT_THROW(slideOnItself(given, options), Error);
}

TEST(SlidingSurface, LinesAreDividedByTheirLength) {
  const AdaptShape box = unevenBox(10);
  const MeshLinks links(box.positions.size(), box.triangles);
  const SlidingSurface surface(links, box.positions, 0.7);
  std::vector<Vec3d> vertices = box.positions;
  surface.divideLines(vertices, std::vector<double>(vertices.size(), 1.0), 1.0);
  for (size_t v = 0; v < vertices.size(); ++v) {
    const Vec3d &from = box.positions[v], &to = vertices[v];
    const auto on = (from.cwiseAbs().array() == 1).count();
    for (int axis = 0; axis < 3; ++axis) {
      // The box has tenths of its side at squares: along a line, these become the tenths again.
      const double even = on < 2 ? from[axis] : 2 * std::sqrt((from[axis] + 1) / 2) - 1;
      EXPECT_NEAR(to[axis], even, 1e-12) << v;
    }
  }
}

TEST(SlidingSurface, ALineWithoutEndsKeepsItsMeanPlace) {
  // A disk of triangles whose rim of 12 crowds to one side.
  AdaptShape disk;
  constexpr size_t kRim = 12;
  for (size_t i = 0; i < kRim; ++i) {
    const double even = 2 * 3.14159265358979 * static_cast<double>(i) / kRim;
    const double angle = even + 0.4 * std::sin(even);
    disk.positions.emplace_back(std::cos(angle), std::sin(angle), 0);
    const auto at = static_cast<uint32_t>(i);
    disk.triangles.insert(disk.triangles.end(), {at, (at + 1) % uint32_t{kRim}, uint32_t{kRim}});
  }
  disk.positions.emplace_back(0, 0, 0);
  const MeshLinks links(disk.positions.size(), disk.triangles);
  const SlidingSurface surface(links, disk.positions, 1.2);
  EXPECT_EQ(surface.lineCount(), kRim);
  std::vector<Vec3d> vertices = disk.positions;
  surface.divideLines(vertices, std::vector<double>(vertices.size(), 1.0), 1.0);
  std::vector<double> lengths;
  for (size_t i = 0; i < kRim; ++i) {
    lengths.push_back((vertices[(i + 1) % kRim] - vertices[i]).norm());
    EXPECT_NEAR(
        std::atan2(vertices[i].y(), vertices[i].x()),
        std::remainder(2 * 3.14159265358979 * static_cast<double>(i) / kRim, 2 * 3.14159265358979),
        0.15);
  }
  // Chords of the given polygon: they are as long as each other but for its corners.
  EXPECT_LT(deviationOf(lengths), 0.05);
}

TEST(SlidingSurface, VerticesKeepToWhatIsAroundThem) {
  const AdaptShape box = unevenBox(4);
  const MeshLinks links(box.positions.size(), box.triangles);
  const SlidingSurface surface(links, box.positions, 0.7);
  EXPECT_EQ(surface.heldCount(), 8u);
  EXPECT_EQ(surface.lineCount(), 12u * 3);
  // A vertex of a face that is pushed over an edge ends at the edge, not on the next face.
  std::vector<Vec3d> vertices = box.positions;
  for (Vec3d& p : vertices) p += Vec3d(0.3, 3, 0.1);
  surface.land(vertices);
  for (size_t v = 0; v < vertices.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(box.positions[v][axis]) == 1) {
        EXPECT_NEAR(vertices[v][axis], box.positions[v][axis], 1e-12);
      }
    }
  }
}

TEST(SlidingSurface, WhereSheetsTouchInAPointItStays) {
  // Two squares of two triangles that share a corner.
  const std::vector<Vec3d> positions = {{0, 0, 0},  {1, 0, 0},   {1, 1, 0}, {0, 1, 0},
                                        {-1, 0, 0}, {-1, -1, 0}, {0, -1, 0}};
  const std::vector<uint32_t> triangles = {0, 1, 2, 0, 2, 3, 0, 4, 5, 0, 5, 6};
  const MeshLinks links(7, triangles);
  EXPECT_EQ(SlidingSurface(links, positions, 0.7).heldCount(), 7u);  // corners all
  std::vector<Vec3d> vertices(7, Vec3d(5, 5, 5));
  SlidingSurface(links, positions, 0.7).land(vertices);
  EXPECT_EQ(vertices, positions);
}

}  // namespace
}  // namespace stipple
