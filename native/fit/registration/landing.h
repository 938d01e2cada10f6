#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// Brings every vertex to the nearest place of a surface; those at borders, and at edges of more
/// than two triangles, to the nearest of such edges, where the surface has some. In: positions
/// [V,3], triangles [F,3] of the surface, F > 0, with seams or without; links of the vertices;
/// vertices [n] in the same frame. Threads and determinism: parallel; same result for any number of
/// threads. Cost: O((F + n) log F).
void landOnSurface(std::span<const float> positions, std::span<const uint32_t> triangles,
                   const MeshLinks& links, std::span<Vec3d> vertices);

}  // namespace stipple
