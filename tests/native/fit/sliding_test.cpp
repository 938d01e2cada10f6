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
#include "fit/registration/sliding_surface.h"
#include "mesh/adapt/density_energy.h"
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

/// Standard deviation of the lengths around vertices, over their mean.
double unevenness(const TriMesh& mesh) {
  const std::vector<Vec3d> places = placesOf(mesh);
  const MeshLinks links(places.size(), mesh.triangles);
  const VertexLengths lengths = vertexLengths(links, places);
  double sum = 0;
  for (const double length : lengths.lengths) sum += std::pow(length - lengths.mean, 2);
  return std::sqrt(sum / static_cast<double>(places.size())) / lengths.mean;
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
  const RegisteredMesh made = slideOnItself(given, quick(300));
  EXPECT_EQ(made.mesh.triangles, given.triangles);
  EXPECT_LT(unevenness(made.mesh), 0.6 * unevenness(given));
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
  withThreads(1, [&] { alone = slideOnItself(given, quick(300)); });
  EXPECT_EQ(alone.mesh.positions, made.mesh.positions);
}

TEST(Sliding, WithoutSharpEdgesABoxIsCut) {
  RegistrationOptions options = quick(300);
  options.sharp_angle = 3.14;
  const TriMesh given = meshOf(unevenBox(10));
  // What the sharp angle is for: vertices leave the edges.
  EXPECT_LT(areaOf(slideOnItself(given, options).mesh), 23.9);
}

TEST(Sliding, ASheetKeepsItsBorderAndDetailGetsMore) {
  const AdaptShape sheet = bumpySheet(24, 0.3);
  const TriMesh given = meshOf(sheet);
  RegistrationOptions options = quick(300);
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
