#include "mesh/adapt/corner_normals.h"

#include <gtest/gtest.h>

#include <cmath>

#include "adapt_meshes.h"
#include "mesh/adapt/merged_vertices.h"

namespace stipple {
namespace {

/// A sheet of two triangles that is folded along its diagonal from (0,0) to (1,1).
TriMesh folded(bool is_soft) {
  TriMesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  mesh.triangles = {0, 1, 2, 0, 2, 3};
  mesh.materials.resize(1);
  for (int corner = 0; corner < 6; ++corner) {
    const float tilt = is_soft || corner < 3 ? 0.0f : 0.1f;
    mesh.corner_normals.insert(mesh.corner_normals.end(), {tilt, 0, 1});
  }
  return mesh;
}

TEST(CornerNormals, StaySoftWhereTheyWereOne) {
  TriMesh mesh = folded(true);
  const auto merged = mergeVertices(mesh.positions, mesh.triangles);
  mesh.positions[5] = -1;  // The corner at (1,0) goes down.
  renewCornerNormals(mesh, merged.place_of);
  for (size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(mesh.corner_normals[axis], mesh.corner_normals[9 + axis]);
    EXPECT_EQ(mesh.corner_normals[6 + axis], mesh.corner_normals[12 + axis]);
  }
  // (0,0,0), (1,0,-1), (1,1,0) has the normal (1,-1,1) / sqrt(3); the other one still has z.
  EXPECT_NEAR(mesh.corner_normals[3], 1 / std::sqrt(3.0), 1e-6);
  EXPECT_NEAR(mesh.corner_normals[15 + 2], 1, 1e-6);
  EXPECT_GT(mesh.corner_normals[2], 0.6f);
  EXPECT_LT(mesh.corner_normals[2], 0.99f);
}

TEST(CornerNormals, StayHardWhereTheyWereTwo) {
  TriMesh mesh = folded(false);
  const auto merged = mergeVertices(mesh.positions, mesh.triangles);
  mesh.positions[5] = -1;
  renewCornerNormals(mesh, merged.place_of);
  for (size_t corner = 0; corner < 6; ++corner) {
    EXPECT_NEAR(mesh.corner_normals[corner * 3 + 2], corner < 3 ? 1 / std::sqrt(3.0) : 1.0, 1e-6);
  }
}

TEST(CornerNormals, AreLeftAloneWithoutArea) {
  TriMesh mesh = folded(true);
  const std::vector<float> before = mesh.corner_normals;
  const auto merged = mergeVertices(mesh.positions, mesh.triangles);
  mesh.positions.assign(12, 0.0f);
  renewCornerNormals(mesh, merged.place_of);
  EXPECT_EQ(mesh.corner_normals, before);
  mesh.corner_normals.clear();
  renewCornerNormals(mesh, merged.place_of);
  EXPECT_TRUE(mesh.corner_normals.empty());
}

}  // namespace
}  // namespace stipple
