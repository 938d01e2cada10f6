#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/meshes/tri_mesh.h"
#include "math/camera.h"
#include "math/empty_depth.h"
#include "math/vec.h"

namespace stipple {

/// One placed mesh.
struct MeshInstance {
  const TriMesh* mesh = nullptr;              ///< validate() accepts it, or it has no triangle
  Mat4d object_to_world = Mat4d::Identity();  ///< validateAffine accepts it
};

/// Planar z of the nearest triangle, either side, on the ray through each pixel's centre between
/// the near and far plane; kEmptyDepth where there is none. Triangles that share an edge leave no
/// gap along it. Out: depth [H,W], row 0 = top. Same bits for any number of threads. Errors:
/// kInvalidArgument for a camera or matrix outside its range, or a depth of another size.
void drawMeshDepth(std::span<const MeshInstance> instances, const Camera& camera,
                   std::span<float> depth, Progress* progress = nullptr);

/// Bytes that it allocates at most.
uint64_t meshDepthMemoryBound(std::span<const MeshInstance> instances);

}  // namespace stipple
