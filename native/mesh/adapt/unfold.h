#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// Triangles whose normal is turned by more than 120 degrees from the mean of those of the
/// triangles at their edges, ascending. Edges of more than two triangles do not count. In: places
/// [vertices].
std::vector<uint32_t> foldedTriangles(const MeshLinks& links, std::span<const Vec3d> places);

/// Smooths away small folds: vertices of folded triangles, and after some rounds those around
/// them, go to the middle of their neighbours, until no triangle is folded or nothing helps. Those
/// at borders stay. What is kept are the places with the fewest folds that were met. Places [n] in,
/// out. Returns how many triangles were folded before. Cost: O(rounds n), 40 rounds at most.
size_t unfold(const MeshLinks& links, std::span<Vec3d> places);

}  // namespace stipple
