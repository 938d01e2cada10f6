#include "mesh/adapt/merged_vertices.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace stipple {

namespace {

std::array<float, 3> placeOf(std::span<const float> positions, uint32_t vertex) {
  const float* p = &positions[size_t{vertex} * 3];
  return {p[0], p[1], p[2]};
}

/// The first vertex at the place of each vertex.
std::vector<uint32_t> firstAtPlace(std::span<const float> positions) {
  std::vector<uint32_t> order(positions.size() / 3);
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const auto p = placeOf(positions, a), q = placeOf(positions, b);
    return p != q ? p < q : a < b;
  });
  std::vector<uint32_t> first(order.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && placeOf(positions, order[i]) == placeOf(positions, order[i - 1]);
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

}  // namespace

MergedVertices mergeVertices(std::span<const float> positions,
                             std::span<const uint32_t> triangles) {
  const std::vector<uint32_t> first = firstAtPlace(positions);
  std::vector<uint8_t> used(first.size(), 0);
  for (const uint32_t vertex : triangles) used[first[vertex]] = 1;
  MergedVertices merged;
  merged.place_of.assign(first.size(), kLooseVertex);
  for (uint32_t v = 0; v < first.size(); ++v) {
    if (first[v] != v || !used[v]) continue;
    merged.place_of[v] = static_cast<uint32_t>(merged.positions.size());
    const auto p = placeOf(positions, v);
    merged.positions.emplace_back(p[0], p[1], p[2]);
  }
  // A duplicate that no triangle uses moves with the place that it shares.
  for (uint32_t v = 0; v < first.size(); ++v) merged.place_of[v] = merged.place_of[first[v]];
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    const uint32_t a = merged.place_of[triangles[t]];
    const uint32_t b = merged.place_of[triangles[t + 1]];
    const uint32_t c = merged.place_of[triangles[t + 2]];
    if (a == b || b == c || c == a) continue;
    merged.triangles.insert(merged.triangles.end(), {a, b, c});
  }
  return merged;
}

}  // namespace stipple
