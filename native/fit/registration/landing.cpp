#include "fit/registration/landing.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "mesh/adapt/merged_vertices.h"
#include "mesh/adapt/point_rows.h"
#include "mesh/surface_search.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1024;

/// Edges of other than two triangles, each as a triangle without area, whatever seams there are.
std::vector<uint32_t> borderEdges(std::span<const uint32_t> triangles,
                                  const std::vector<uint32_t>& place_of) {
  using Edge = std::pair<std::pair<uint32_t, uint32_t>, std::pair<uint32_t, uint32_t>>;
  std::vector<Edge> edges;  // by places, with vertices
  for (size_t corner = 0; corner < triangles.size(); ++corner) {
    const uint32_t a = triangles[corner], b = triangles[corner / 3 * 3 + (corner + 1) % 3];
    if (place_of[a] != place_of[b])
      edges.push_back({std::minmax(place_of[a], place_of[b]), {a, b}});
  }
  std::sort(edges.begin(), edges.end());
  std::vector<uint32_t> border;
  for (size_t i = 0; i < edges.size();) {
    size_t past = i;
    while (past < edges.size() && edges[past].first == edges[i].first) ++past;
    const auto [a, b] = edges[i].second;
    if (past - i != 2) border.insert(border.end(), {a, b, b});
    i = past;
  }
  return border;
}

}  // namespace

void landOnSurface(std::span<const float> positions, std::span<const uint32_t> triangles,
                   const MeshLinks& links, std::span<Vec3d> vertices) {
  const std::vector<uint32_t> border =
      borderEdges(triangles, mergeVertices(positions, triangles).place_of);
  const SurfaceSearch surface(positions, triangles);
  std::optional<SurfaceSearch> edges;
  if (!border.empty()) edges.emplace(positions, border);
  parallelFor(vertices.size(), kGrain, [&](size_t begin, size_t end) {
    std::vector<SurfacePlace> places;
    for (size_t v = begin; v < end; ++v) {
      const bool on_border = edges && links.isBorder(v);
      const std::span<const uint32_t> faces = on_border ? std::span(border) : triangles;
      (on_border ? *edges : surface).nearest(vertices[v], 1, places);
      const SurfacePlace& place = places[0];
      vertices[v].setZero();
      for (size_t corner = 0; corner < 3; ++corner) {
        vertices[v] +=
            place.weights[corner] * rowOf(positions, faces[size_t{place.triangle} * 3 + corner]);
      }
    }
  });
}

}  // namespace stipple
