#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

constexpr uint32_t kLooseVertex = UINT32_MAX;

/// The surface of a mesh with each place once, whatever seams its vertices were split for.
struct MergedVertices {
  std::vector<Vec3d> positions;     ///< [n] in the order of the first vertex at each place
  std::vector<uint32_t> triangles;  ///< [F,3] without those that have fewer than three places
  std::vector<uint32_t> place_of;   ///< [V] of each vertex; kLooseVertex where no triangle uses it
};

/// Merges vertices whose three numbers are equal (0 equals -0), and nothing that is merely near:
/// two islands that touch in a vertex become one. In: positions [V,3] finite; triangles [T,3]
/// indices below V. Threads and determinism: one thread. Cost: O(V log V).
MergedVertices mergeVertices(std::span<const float> positions, std::span<const uint32_t> triangles);

}  // namespace stipple
