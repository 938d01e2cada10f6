#include "mesh/winding_number.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "base/parallel.h"

namespace stipple {
namespace {

/// A sphere about the origin, faces outwards; rings above `open` (0..1 of the height) are missing.
TriMesh sphere(uint32_t segments, uint32_t rings, double radius = 1, double open = 1) {
  TriMesh mesh;
  mesh.materials.resize(1);
  for (uint32_t r = 0; r <= rings; ++r) {
    for (uint32_t s = 0; s < segments; ++s) {
      const double theta = M_PI * r / rings;
      const double phi = 2 * M_PI * s / segments;
      mesh.positions.push_back(static_cast<float>(radius * std::sin(theta) * std::cos(phi)));
      mesh.positions.push_back(static_cast<float>(radius * std::sin(theta) * std::sin(phi)));
      mesh.positions.push_back(static_cast<float>(-radius * std::cos(theta)));
    }
  }
  for (uint32_t r = 0; r < rings; ++r) {
    if (r >= open * rings) break;
    for (uint32_t s = 0; s < segments; ++s) {
      const uint32_t a = r * segments + s, b = r * segments + (s + 1) % segments;
      for (const uint32_t i : {a, b, b + segments, a, b + segments, a + segments}) {
        mesh.triangles.push_back(i);
      }
    }
  }
  return mesh;
}

std::vector<Vec3d> randomPoints(size_t count, double reach, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-reach, reach);
  std::vector<Vec3d> points(count);
  for (Vec3d& p : points) p = Vec3d(u(random), u(random), u(random));
  return points;
}

TEST(WindingNumber, IsOneInsideAndZeroOutsideAClosedMesh) {
  const WindingNumber winding(sphere(48, 24));
  for (const Vec3d& p : randomPoints(3000, 2, 1)) {
    if (std::abs(p.norm() - 1) < 0.01) continue;  // between the facets and the sphere
    EXPECT_NEAR(winding.exactAt(p), p.norm() < 1 ? 1 : 0, 1e-9);
  }
}

TEST(WindingNumber, TreeAgreesWithTheSumOverAllTriangles) {
  for (const double open : {1.0, 0.7}) {
    const WindingNumber winding(sphere(96, 48, 1, open));
    double worst = 0;
    for (const Vec3d& p : randomPoints(4000, 1.5, 2)) {
      worst = std::max(worst, std::abs(winding.at(p) - winding.exactAt(p)));
    }
    EXPECT_LT(worst, 0.04);  // what the header promises
  }
}

TEST(WindingNumber, DecidesSensiblyForAMeshWithAHole) {
  // The top 30 % of the height of the rings is missing: deep inside is still inside.
  const TriMesh bowl = sphere(48, 24, 1, 0.7);
  const float points[] = {0, 0, -0.9f, 0,    0, 0, 0.6f, 0, -0.3f,
                          0, 0, 1.5f,  1.2f, 0, 0, 0,    0, -1.1f};
  EXPECT_EQ(insideMesh(bowl, points, Mat4d::Identity(), nullptr),
            (std::vector<uint8_t>{1, 1, 1, 0, 0, 0}));
}

TEST(InsideMesh, DoesNotCareWhichWayFacesLook) {
  TriMesh inside_out = sphere(24, 12);
  for (size_t t = 0; t < inside_out.triangles.size(); t += 3) {
    std::swap(inside_out.triangles[t], inside_out.triangles[t + 1]);
  }
  const float points[] = {0, 0, 0, 0.5f, 0.5f, 0, 2, 0, 0};
  EXPECT_EQ(insideMesh(inside_out, points, Mat4d::Identity(), nullptr),
            (std::vector<uint8_t>{1, 1, 0}));
}

TEST(InsideMesh, BringsPointsIntoTheFrameOfTheMesh) {
  Mat4d matrix = Mat4d::Identity();
  matrix(0, 0) = 2;
  matrix(0, 3) = -4;  // x of the mesh = 2 x - 4
  const float points[] = {2, 0, 0, 2.4f, 0, 0, 2.6f, 0, 0, 0, 0, 0};
  EXPECT_EQ(insideMesh(sphere(48, 24), points, matrix, nullptr),
            (std::vector<uint8_t>{1, 1, 0, 0}));
}

TEST(InsideMesh, OverlappingAndNestedPartsCountAsInside) {
  TriMesh mesh = sphere(24, 12);
  const TriMesh inner = sphere(24, 12, 0.5);
  const uint32_t before = static_cast<uint32_t>(mesh.vertexCount());
  mesh.positions.insert(mesh.positions.end(), inner.positions.begin(), inner.positions.end());
  for (const uint32_t i : inner.triangles) mesh.triangles.push_back(before + i);
  const float points[] = {0, 0, 0, 0.7f, 0, 0};
  EXPECT_EQ(insideMesh(mesh, points, Mat4d::Identity(), nullptr), (std::vector<uint8_t>{1, 1}));
}

TEST(InsideMesh, ASheetHasNoInside) {
  TriMesh sheet;
  sheet.materials.resize(1);
  sheet.positions = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  sheet.triangles = {0, 1, 2, 0, 2, 3};
  const float points[] = {0, 0, 1e-3f, 0, 0, -1e-3f, 3, 3, 0};
  EXPECT_EQ(insideMesh(sheet, points, Mat4d::Identity(), nullptr), (std::vector<uint8_t>{0, 0, 0}));
}

TEST(InsideMesh, DegenerateTrianglesDoNoHarm) {
  TriMesh mesh = sphere(16, 8);  // its poles are degenerate already
  for (const uint32_t i : {0u, 0u, 0u, 5u, 5u, 9u}) mesh.triangles.push_back(i);
  const float points[] = {0, 0, 0, 0, 0, 2, mesh.positions[0], mesh.positions[1], 3};
  EXPECT_EQ(insideMesh(mesh, points, Mat4d::Identity(), nullptr), (std::vector<uint8_t>{1, 0, 0}));
}

TEST(InsideMesh, SameForAnyNumberOfThreadsAndStopsWhenCancelled) {
  const TriMesh mesh = sphere(48, 24);
  std::vector<float> points;
  for (const Vec3d& p : randomPoints(20000, 1.2, 3)) {
    for (int k = 0; k < 3; ++k) points.push_back(static_cast<float>(p[k]));
  }
  std::vector<uint8_t> one, two;
  withThreads(1, [&] { one = insideMesh(mesh, points, Mat4d::Identity(), nullptr); });
  withThreads(2, [&] { two = insideMesh(mesh, points, Mat4d::Identity(), nullptr); });
  EXPECT_EQ(one, two);
  Progress cancelled;
  cancelled.cancel();
  EXPECT_THROW(insideMesh(mesh, points, Mat4d::Identity(), &cancelled), Error);
  EXPECT_THROW(insideMesh(TriMesh{}, points, Mat4d::Identity(), nullptr), Error);
}

}  // namespace
}  // namespace stipple
