#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/meshes/tri_mesh.h"
#include "math/camera.h"
#include "mesh/surface_colour.h"

namespace stipple {

/// A mesh as it is, without light, as its splats are to look: the nearest triangle, either side, in
/// the colours that sampleSurface gives its samples, as they look from the camera, averaged in
/// scene linear over samples x samples rays a pixel. Where a surface is transparent, a share of the
/// rays goes on. In: colour: of the mesh, which validate() accepts. Out: rgba [H,W,4] display
/// values, associated alpha, row 0 = top. Same bits for any number of threads. Errors:
/// kInvalidArgument for a camera outside its range, 0 or more than 16 samples, an image of another
/// size.
void drawMeshImage(const TriMesh& mesh, const SurfaceColour& colour, const Camera& camera,
                   uint32_t samples, std::span<float> rgba, Progress* progress = nullptr);

/// Bytes that it allocates at most.
uint64_t meshImageMemoryBound(const TriMesh& mesh, const Camera& camera, uint32_t samples);

}  // namespace stipple
