// Based on: Thürmer, Wüthrich, Computing Vertex Normals from Polygonal Facets, Journal of Graphics
// Tools 1998 (weights by angle).
#include "mesh/adapt/corner_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/moving_samples.h"
#include "mesh/adapt/point_rows.h"

namespace stipple {

namespace {

Vec3d cornerPlace(const TriMesh& mesh, size_t corner) {
  return rowOf(mesh.positions, mesh.triangles[corner]);
}

/// The normal of a corner's triangle, as long as its angle there; 0 without area.
Vec3d anglePart(const TriMesh& mesh, size_t corner) {
  const size_t first = corner / 3 * 3;
  const Vec3d at = cornerPlace(mesh, corner);
  const Vec3d next = cornerPlace(mesh, first + (corner + 1) % 3);
  const Vec3d last = cornerPlace(mesh, first + (corner + 2) % 3);
  const Vec3d places[3] = {at, next, last};
  const uint32_t own[3] = {0, 1, 2};
  const Vec3d across = areaVector(own, places, 0);
  const double length = across.norm();
  if (!(length > 0)) return Vec3d::Zero();
  return across / length * std::atan2(length, (next - at).dot(last - at));
}

}  // namespace

void renewCornerNormals(TriMesh& mesh, std::span<const uint32_t> place_of) {
  if (mesh.corner_normals.empty()) return;
  const auto keyOf = [&](uint32_t corner) {
    const float* normal = &mesh.corner_normals[size_t{corner} * 3];
    return std::tuple(place_of[mesh.triangles[corner]], normal[0], normal[1], normal[2]);
  };
  std::vector<uint32_t> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const auto first = keyOf(a), second = keyOf(b);
    return first != second ? first < second : a < b;
  });
  std::vector<float> renewed = mesh.corner_normals;
  for (size_t begin = 0; begin < order.size();) {
    size_t end = begin;
    Vec3d sum = Vec3d::Zero();
    while (end < order.size() && keyOf(order[end]) == keyOf(order[begin])) {
      sum += anglePart(mesh, order[end++]);
    }
    // Parts that cancel out say nothing; the corner keeps what it had.
    const bool is_known = sum.norm() > 1e-9;
    for (size_t i = begin; i < end && is_known; ++i) {
      setRow(renewed, order[i], sum.normalized());
    }
    begin = end;
  }
  mesh.corner_normals = std::move(renewed);
}

}  // namespace stipple
