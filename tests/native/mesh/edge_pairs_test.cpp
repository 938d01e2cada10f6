#include "mesh/edge_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "mesh/surface_pieces.h"

namespace stipple {
namespace {

/// Adds a box as triangles over a grid of points of side 1: shared points make boxes touch.
void addBox(TriMesh& mesh, int x, int y, int z) {
  const auto vertex = [&](uint32_t k) {
    const float p[3] = {static_cast<float>(x + static_cast<int>(k & 1)),
                        static_cast<float>(y + static_cast<int>(k >> 1 & 1)),
                        static_cast<float>(z + static_cast<int>(k >> 2 & 1))};
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
      if (std::equal(p, p + 3, &mesh.positions[v * 3])) return v;
    }
    mesh.positions.insert(mesh.positions.end(), p, p + 3);
    return static_cast<uint32_t>(mesh.vertexCount() - 1);
  };
  const uint32_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    for (const auto& t : {std::array<uint32_t, 3>{q[0], q[1], q[2]}, {q[0], q[2], q[3]}}) {
      for (const uint32_t corner : t) mesh.triangles.push_back(vertex(corner));
    }
  }
}

void expectClosed(const TriMesh& mesh, double volume) {
  const MeshTopology topology = topologyOf(mesh);
  EXPECT_EQ(topology.open_edge_count, 0u);
  EXPECT_NEAR(topology.volume, volume, 1e-12);
}

TEST(EdgePairs, LeavesAGoodMeshAsItIs) {
  TriMesh mesh;
  addBox(mesh, 0, 0, 0);
  const std::vector<uint32_t> before = mesh.triangles;
  EXPECT_EQ(pairEdges(mesh), 0u);
  EXPECT_EQ(mesh.triangles, before);
}

TEST(EdgePairs, PartsBoxesThatShareAnEdge) {
  TriMesh mesh;
  addBox(mesh, 0, 0, 0);
  addBox(mesh, 1, 1, 0);
  EXPECT_EQ(topologyOf(mesh).open_edge_count, 1u);
  EXPECT_EQ(pairEdges(mesh), 1u);
  EXPECT_EQ(mesh.vertexCount(), 15u);
  expectClosed(mesh, 2.0);
}

TEST(EdgePairs, PartsTrianglesWithSeveralCrowdedEdges) {
  TriMesh mesh;  // every second cell of a cube: twelve edges with four triangles or more
  for (int i = 0; i < 8; ++i) {
    const int x = i & 1, y = i >> 1 & 1, z = i >> 2 & 1;
    if ((x + y + z) % 2 == 0) addBox(mesh, x, y, z);
  }
  EXPECT_EQ(pairEdges(mesh), 6u);
  expectClosed(mesh, 4.0);
}

TEST(EdgePairs, DropsTrianglesWithoutAreaAndPairsThatCancel) {
  TriMesh mesh;
  addBox(mesh, 0, 0, 0);
  const size_t good = mesh.triangles.size();
  mesh.triangles.insert(mesh.triangles.end(), {0, 0, 1, 0, 1, 5, 0, 5, 1});
  EXPECT_EQ(pairEdges(mesh), 0u);
  EXPECT_EQ(mesh.triangles.size(), good);
  expectClosed(mesh, 1.0);
}

TEST(EdgePairs, RefusesAnOpenSurface) {
  TriMesh mesh;
  addBox(mesh, 0, 0, 0);
  mesh.triangles.resize(mesh.triangles.size() - 3);
  EXPECT_THROW(pairEdges(mesh), Error);
}

}  // namespace
}  // namespace stipple
