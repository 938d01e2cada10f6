#include "mesh/surface_pieces.h"

#include <gtest/gtest.h>

#include <string>

#include "base/error.h"

namespace stipple {
namespace {

/// A box as six quads, corner k at bit k of x, y, z.
PolygonSurface box(float size, float x, bool inward = false) {
  PolygonSurface surface;
  for (uint32_t k = 0; k < 8; ++k) {
    surface.points.insert(surface.points.end(),
                          {x + (k & 1 ? size : 0), k & 2 ? size : 0, k & 4 ? size : 0});
  }
  surface.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                   {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  if (inward) {
    for (auto& face : surface.faces) std::swap(face[1], face[3]);
  }
  return surface;
}

void append(PolygonSurface& to, const PolygonSurface& from) {
  const uint32_t first = static_cast<uint32_t>(to.points.size() / 3);
  to.points.insert(to.points.end(), from.points.begin(), from.points.end());
  for (auto face : from.faces) {
    for (uint32_t& corner : face) corner += first;
    to.faces.push_back(face);
  }
}

TEST(SurfacePieces, SplitsQuadsAndKeepsTriangles) {
  PolygonSurface surface = box(2, 0);
  surface.faces.push_back({0, 1, 2, kNoCorner});
  const TriMesh mesh = triangulated(surface);
  EXPECT_EQ(mesh.triangleCount(), 13u);
  EXPECT_EQ(mesh.materials.size(), 1u);
}

TEST(SurfacePieces, SplitsAlongTheShorterDiagonal) {
  PolygonSurface surface;
  surface.points = {0, 0, 0, 3, 0, 0, 4, 1, 0, 1, 1, 0};  // 0-2 is longer than 1-3
  surface.faces = {{0, 1, 2, 3}};
  EXPECT_EQ(triangulated(surface).triangles, (std::vector<uint32_t>{0, 1, 3, 1, 2, 3}));
}

TEST(SurfacePieces, KnowsABox) {
  const MeshTopology topology = topologyOf(triangulated(box(2, 5)));
  EXPECT_EQ(topology.edge_count, 18u);
  EXPECT_EQ(topology.open_edge_count, 0u);
  EXPECT_EQ(topology.piece_count, 1u);
  EXPECT_EQ(topology.euler, 2);
  EXPECT_DOUBLE_EQ(topology.volume, 8.0);
}

TEST(SurfacePieces, SeesHolesAndTurnedFaces) {
  PolygonSurface open = box(1, 0);
  open.faces.pop_back();
  EXPECT_EQ(topologyOf(triangulated(open)).open_edge_count, 4u);
  PolygonSurface turned = box(1, 0);
  std::swap(turned.faces[0][1], turned.faces[0][3]);
  EXPECT_EQ(topologyOf(triangulated(turned)).open_edge_count, 4u);
  TriMesh inward = triangulated(box(1, 0));
  for (size_t i = 0; i < inward.triangles.size(); i += 3) {
    std::swap(inward.triangles[i], inward.triangles[i + 1]);
  }
  EXPECT_DOUBLE_EQ(topologyOf(inward).volume, -1.0);
}

TEST(SurfacePieces, TurnsASurfaceOutward) {
  const TriMesh mesh = triangulated(box(1, 0, true));
  EXPECT_DOUBLE_EQ(topologyOf(mesh).volume, 1.0);
  EXPECT_EQ(topologyOf(mesh).open_edge_count, 0u);
}

TEST(SurfacePieces, KeepsThePieceThatEnclosesMostWithoutHollows) {
  PolygonSurface surface = box(1, -4);
  append(surface, box(3, 0));
  append(surface, box(2, 0.5f, true));  // a hollow
  TriMesh mesh = triangulated(surface);
  const MeshTopology before = topologyOf(mesh);
  EXPECT_EQ(before.piece_count, 3u);
  EXPECT_NEAR(before.volume, 1 + 27 - 8, 1e-12);
  EXPECT_EQ(keepLargestPiece(mesh), 3u);
  EXPECT_EQ(mesh.vertexCount(), 8u);
  const MeshTopology after = topologyOf(mesh);
  EXPECT_EQ(after.piece_count, 1u);
  EXPECT_EQ(after.euler, 2);
  EXPECT_DOUBLE_EQ(after.volume, 27.0);
}

TEST(SurfacePieces, LeavesNothingAsItIs) {
  TriMesh mesh;
  EXPECT_EQ(keepLargestPiece(mesh), 0u);
  EXPECT_EQ(topologyOf(mesh).euler, 0);
}

TEST(SurfacePieces, CanBeCancelled) {
  TriMesh mesh = triangulated(box(1, 0));
  Progress progress;
  progress.cancel();
  EXPECT_THROW(keepLargestPiece(mesh, &progress), Error);
}

}  // namespace
}  // namespace stipple
