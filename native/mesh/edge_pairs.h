#pragma once

#include <cstdint>

#include "data/meshes/tri_mesh.h"

namespace stipple {

/// Makes each edge the border of exactly two triangles, for a surface whose triangles run along
/// every edge as often one way as the other (the border of a solid, however its parts touch).
/// Triangles without an area by their indices, and pairs of one triangle and its reverse, go. Where
/// 2 k > 2 triangles share an edge they are paired in their order around it, and every pair but one
/// gets a vertex of its own in the edge's middle; no point of the surface moves.
/// Returns how many edges there were of more than two triangles. Errors: kInternal where an edge's
/// triangles do not cancel. Cost: O(T log T).
uint64_t pairEdges(TriMesh& mesh);

}  // namespace stipple
