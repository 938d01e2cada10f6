#pragma once

#include <cstdint>

#include "base/progress.h"
#include "data/meshes/polygon_surface.h"
#include "data/meshes/tri_mesh.h"

namespace stipple {

/// The surface in triangles, one grey material, counterclockwise from outside where it is closed:
/// the volume that it encloses is positive. Quads are split along their shorter diagonal.
TriMesh triangulated(const PolygonSurface& surface);

/// Pieces are triangles that share vertices. Keeps the one that encloses the largest volume, and
/// the vertices that it uses, in their order; hollows inside it are pieces of their own and go.
/// Returns the number of pieces that there were. Cost: O(T).
uint64_t keepLargestPiece(TriMesh& mesh, Progress* progress = nullptr);

struct MeshTopology {
  uint64_t edge_count = 0;
  uint64_t open_edge_count = 0;  ///< that two faces, running against each other, do not share
  uint64_t piece_count = 0;
  int64_t euler = 0;  ///< vertices - edges + triangles: 2 for a sphere
  double volume =
      0.0;  ///< enclosed, cubic metres; hollows count less, faces turned inward negative
};
/// Of the positions and triangles; unused vertices do not count. Cost: O(T log T), 16 bytes per
/// edge of a triangle and 5 per vertex.
MeshTopology topologyOf(const TriMesh& mesh);

}  // namespace stipple
