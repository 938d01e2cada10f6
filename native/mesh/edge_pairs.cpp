#include "mesh/edge_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "math/vec.h"

namespace stipple {

namespace {

struct HalfEdge {
  uint64_t ends;  ///< smaller vertex above, larger below
  uint32_t triangle;
  uint8_t corner;   ///< where the edge starts in the triangle
  bool is_forward;  ///< runs from the smaller vertex to the larger
};

Vec3d pointAt(const TriMesh& mesh, uint32_t vertex) {
  const float* p = &mesh.positions[size_t{vertex} * 3];
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

/// Removes triangles with equal corners, and triangles together with their reverse.
void dropFlat(TriMesh& mesh) {
  struct Face {
    std::array<uint32_t, 3> sorted;
    uint32_t triangle;
    bool is_even;  ///< an even permutation of the sorted corners
  };
  const size_t count = mesh.triangleCount();
  std::vector<uint8_t> drop(count, 0);
  std::vector<Face> faces;
  faces.reserve(count);
  for (uint32_t t = 0; t < count; ++t) {
    const uint32_t* v = &mesh.triangles[size_t{t} * 3];
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) {
      drop[t] = 1;
      continue;
    }
    Face face{{v[0], v[1], v[2]}, t, true};
    std::sort(face.sorted.begin(), face.sorted.end());
    const size_t first = static_cast<size_t>(std::find(v, v + 3, face.sorted[0]) - v);
    face.is_even = v[(first + 1) % 3] == face.sorted[1];
    faces.push_back(face);
  }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return a.sorted != b.sorted ? a.sorted < b.sorted : a.triangle < b.triangle;
  });
  for (size_t i = 0; i < faces.size();) {
    size_t end = i;
    while (end < faces.size() && faces[end].sorted == faces[i].sorted) ++end;
    size_t even = 0;
    for (size_t k = i; k < end; ++k) even += faces[k].is_even ? 1 : 0;
    size_t cancel[2] = {std::min(even, end - i - even), std::min(even, end - i - even)};
    for (size_t k = i; k < end; ++k) {
      size_t& left = cancel[faces[k].is_even ? 0 : 1];
      if (left > 0) {
        drop[faces[k].triangle] = 1;
        --left;
      }
    }
    i = end;
  }
  size_t kept = 0;
  for (size_t t = 0; t < count; ++t) {
    if (drop[t]) continue;
    std::copy_n(&mesh.triangles[t * 3], 3, &mesh.triangles[kept * 3]);
    ++kept;
  }
  mesh.triangles.resize(kept * 3);
}

std::vector<HalfEdge> halfEdges(const TriMesh& mesh) {
  std::vector<HalfEdge> edges;
  edges.reserve(mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
    for (uint8_t k = 0; k < 3; ++k) {
      const uint64_t a = mesh.triangles[size_t{t} * 3 + k];
      const uint64_t b = mesh.triangles[size_t{t} * 3 + (k + 1u) % 3];
      edges.push_back({std::min(a, b) << 32 | std::max(a, b), t, k, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return a.ends != b.ends ? a.ends < b.ends : a.triangle < b.triangle;
  });
  return edges;
}

/// The half edges [count] of one edge, in their order around it: each forward one is followed by
/// the backward one that it is paired with.
void orderInPairs(const TriMesh& mesh, HalfEdge* edges, size_t count) {
  const Vec3d a = pointAt(mesh, static_cast<uint32_t>(edges->ends >> 32));
  const Vec3d along = pointAt(mesh, static_cast<uint32_t>(edges->ends)) - a;
  const Vec3d side = along.unitOrthogonal();
  const Vec3d up = along.cross(side);
  std::vector<std::pair<double, HalfEdge>> around;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t apex =
        mesh.triangles[size_t{edges[i].triangle} * 3 + (edges[i].corner + 2u) % 3];
    const Vec3d arm = pointAt(mesh, apex) - a;
    // `up` is |along| times as long as `side`.
    around.emplace_back(std::atan2(arm.dot(up), arm.dot(side) * along.norm()), edges[i]);
  }
  std::sort(around.begin(), around.end(), [](const auto& x, const auto& y) {
    return x.first != y.first ? x.first < y.first : x.second.triangle < y.second.triangle;
  });
  std::vector<uint8_t> taken(count, 0);
  size_t filled = 0;
  for (size_t i = 0; i < count; ++i) {
    if (!around[i].second.is_forward) continue;
    size_t partner = (i + 1) % count;
    while (around[partner].second.is_forward || taken[partner]) partner = (partner + 1) % count;
    taken[partner] = 1;
    edges[filled++] = around[i].second;
    edges[filled++] = around[partner].second;
  }
}

}  // namespace

uint64_t pairEdges(TriMesh& mesh) {
  dropFlat(mesh);
  uint64_t crowded = 0;
  // A triangle is split at one of its edges in a round; three rounds see all edges of one.
  for (bool is_first = true;; is_first = false) {
    std::vector<HalfEdge> edges = halfEdges(mesh);
    std::vector<uint8_t> is_split(mesh.triangleCount(), 0);
    bool any = false;
    for (size_t i = 0; i < edges.size();) {
      size_t end = i;
      size_t forward = 0;
      while (end < edges.size() && edges[end].ends == edges[i].ends) {
        forward += edges[end++].is_forward ? 1 : 0;
      }
      const size_t count = end - i;
      if (2 * forward != count) {
        fail(ErrorCode::kInternal, "the surface is open: " + std::to_string(forward) +
                                       " triangles run one way along an edge and " +
                                       std::to_string(count - forward) + " the other");
      }
      if (count > 2) {
        any = true;
        if (is_first) ++crowded;
        orderInPairs(mesh, &edges[i], count);
        const Vec3d middle = 0.5 * (pointAt(mesh, static_cast<uint32_t>(edges[i].ends >> 32)) +
                                    pointAt(mesh, static_cast<uint32_t>(edges[i].ends)));
        for (size_t pair = i + 2; pair < end; pair += 2) {
          if (is_split[edges[pair].triangle] || is_split[edges[pair + 1].triangle]) continue;
          const uint32_t added = static_cast<uint32_t>(mesh.vertexCount());
          for (int axis = 0; axis < 3; ++axis) {
            mesh.positions.push_back(static_cast<float>(middle[axis]));
          }
          for (const HalfEdge& half : {edges[pair], edges[pair + 1]}) {
            is_split[half.triangle] = 1;
            const size_t first = size_t{half.triangle} * 3;
            const uint32_t v[3] = {mesh.triangles[first + half.corner],
                                   mesh.triangles[first + (half.corner + 1u) % 3],
                                   mesh.triangles[first + (half.corner + 2u) % 3]};
            const uint32_t one[3] = {v[0], added, v[2]};
            std::copy_n(one, 3, mesh.triangles.begin() + static_cast<std::ptrdiff_t>(first));
            mesh.triangles.insert(mesh.triangles.end(), {added, v[1], v[2]});
          }
        }
      }
      i = end;
    }
    if (!any) return crowded;
  }
}

}  // namespace stipple
