#pragma once

#include <cstdint>
#include <span>

#include "data/meshes/tri_mesh.h"

namespace stipple {

/// Normals of a mesh whose vertices have moved: corners that had one normal, bit for bit, in one
/// place have one again, the mean of their triangles' by the angles there; so soft and hard edges
/// stay what they were. A mesh without corner normals is left alone. In: place_of [V] as of
/// MergedVertices. One thread. Cost: O(T log T).
void renewCornerNormals(TriMesh& mesh, std::span<const uint32_t> place_of);

}  // namespace stipple
