#include "mesh/surface_pieces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "math/vec.h"

namespace stipple {

namespace {

Vec3d pointAt(const std::vector<float>& positions, size_t vertex) {
  return {static_cast<double>(positions[vertex * 3]),
          static_cast<double>(positions[vertex * 3 + 1]),
          static_cast<double>(positions[vertex * 3 + 2])};
}

/// The piece of every vertex: a number of one of its vertices. Halves paths, so almost O(1) each.
class Pieces {
 public:
  explicit Pieces(const TriMesh& mesh) : parents_(mesh.vertexCount()) {
    std::iota(parents_.begin(), parents_.end(), 0u);
    for (size_t t = 0; t < mesh.triangles.size(); t += 3) {
      join(mesh.triangles[t], mesh.triangles[t + 1]);
      join(mesh.triangles[t], mesh.triangles[t + 2]);
    }
  }

  uint32_t of(uint32_t vertex) {
    while (parents_[vertex] != vertex) {
      parents_[vertex] = parents_[parents_[vertex]];
      vertex = parents_[vertex];
    }
    return vertex;
  }

 private:
  void join(uint32_t a, uint32_t b) {
    a = of(a);
    b = of(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

  std::vector<uint32_t> parents_;
};

/// Six times the volume between a triangle and a point near the mesh.
double volumeOf(const TriMesh& mesh, size_t triangle, const Vec3d& origin) {
  const uint32_t* corners = &mesh.triangles[triangle * 3];
  const Vec3d a = pointAt(mesh.positions, corners[0]) - origin;
  const Vec3d b = pointAt(mesh.positions, corners[1]) - origin;
  const Vec3d c = pointAt(mesh.positions, corners[2]) - origin;
  return a.dot(b.cross(c));
}

}  // namespace

TriMesh triangulated(const PolygonSurface& surface) {
  TriMesh mesh;
  mesh.positions = surface.points;
  mesh.triangles.reserve(surface.faces.size() * 6);
  for (const auto& face : surface.faces) {
    const auto add = [&](size_t a, size_t b, size_t c) {
      mesh.triangles.insert(mesh.triangles.end(), {face[a], face[b], face[c]});
    };
    if (face[3] == kNoCorner) {
      add(0, 1, 2);
      continue;
    }
    const auto across = [&](size_t a, size_t b) {
      return (pointAt(mesh.positions, face[a]) - pointAt(mesh.positions, face[b])).squaredNorm();
    };
    if (across(0, 2) <= across(1, 3)) {
      add(0, 1, 2);
      add(0, 2, 3);
    } else {
      add(0, 1, 3);
      add(1, 2, 3);
    }
  }
  if (mesh.triangles.empty()) return mesh;
  mesh.materials.resize(1);
  double volume = 0.0;
  const Vec3d origin = pointAt(mesh.positions, mesh.triangles[0]);
  for (size_t t = 0; t < mesh.triangleCount(); ++t) volume += volumeOf(mesh, t, origin);
  if (volume < 0) {
    for (size_t i = 0; i < mesh.triangles.size(); i += 3) {
      std::swap(mesh.triangles[i + 1], mesh.triangles[i + 2]);
    }
  }
  return mesh;
}

uint64_t keepLargestPiece(TriMesh& mesh, Progress* progress) {
  if (mesh.triangles.empty()) return 0;
  advance(progress, 0.0, "Finding pieces");
  Pieces pieces(mesh);
  std::vector<double> volumes(mesh.vertexCount(), 0.0);
  std::vector<uint8_t> used(mesh.vertexCount(), 0);
  const Vec3d origin = pointAt(mesh.positions, mesh.triangles[0]);
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    const uint32_t piece = pieces.of(mesh.triangles[t * 3]);
    volumes[piece] += volumeOf(mesh, t, origin);
    used[piece] = 1;
  }
  uint32_t best = pieces.of(mesh.triangles[0]);
  uint64_t count = 0;
  for (uint32_t piece = 0; piece < volumes.size(); ++piece) {
    if (!used[piece]) continue;
    ++count;
    if (volumes[piece] > volumes[best]) best = piece;
  }
  if (progress) progress->throwIfCancelled();
  std::vector<uint32_t> places(mesh.vertexCount(), kNoCorner);
  size_t vertices = 0;
  for (uint32_t v = 0; v < places.size(); ++v) {
    if (pieces.of(v) != best) continue;
    std::copy_n(&mesh.positions[size_t{v} * 3], 3, &mesh.positions[vertices * 3]);
    places[v] = static_cast<uint32_t>(vertices++);
  }
  size_t kept = 0;
  for (size_t i = 0; i < mesh.triangles.size(); i += 3) {
    if (places[mesh.triangles[i]] == kNoCorner) continue;
    for (size_t k = 0; k < 3; ++k) mesh.triangles[kept++] = places[mesh.triangles[i + k]];
  }
  mesh.positions.resize(vertices * 3);
  mesh.triangles.resize(kept);
  return count;
}

MeshTopology topologyOf(const TriMesh& mesh) {
  MeshTopology topology;
  // Both ends, the smaller above, and which way the triangle runs along it.
  std::vector<std::pair<uint64_t, int>> edges;
  edges.reserve(mesh.triangles.size());
  std::vector<uint8_t> used(mesh.vertexCount(), 0);
  const Vec3d origin =
      mesh.triangles.empty() ? Vec3d::Zero() : pointAt(mesh.positions, mesh.triangles[0]);
  for (size_t t = 0; t < mesh.triangleCount(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t a = mesh.triangles[t * 3 + k];
      const uint64_t b = mesh.triangles[t * 3 + (k + 1) % 3];
      edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), a < b ? 1 : -1);
      used[a] = 1;
    }
    topology.volume += volumeOf(mesh, t, origin) / 6.0;
  }
  std::sort(edges.begin(), edges.end());
  for (size_t i = 0; i < edges.size();) {
    size_t end = i;
    int sum = 0;
    while (end < edges.size() && edges[end].first == edges[i].first) sum += edges[end++].second;
    ++topology.edge_count;
    if (end - i != 2 || sum != 0) ++topology.open_edge_count;
    i = end;
  }
  Pieces pieces(mesh);
  uint64_t vertices = 0;
  for (uint32_t v = 0; v < used.size(); ++v) {
    if (!used[v]) continue;
    ++vertices;
    if (pieces.of(v) == v) ++topology.piece_count;
  }
  topology.euler = static_cast<int64_t>(vertices) - static_cast<int64_t>(topology.edge_count) +
                   static_cast<int64_t>(mesh.triangleCount());
  return topology;
}

}  // namespace stipple
