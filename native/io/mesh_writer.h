#pragma once

#include <string>

#include "data/meshes/tri_mesh.h"

namespace stipple {

/// Writes positions and triangles, nothing else of the mesh, by the extension: .ply (binary,
/// positions as they are) or .glb (Z up turned to Y up, so that readMeshFile gives the same
/// positions back). Errors: kIo; kUnsupported for another extension and for a .glb of 4 GiB and
/// more; kUnavailable for a .glb (media library missing); kInvalidArgument for a mesh that
/// validate() refuses.
void writeMeshFile(const TriMesh& mesh, const std::string& path);

}  // namespace stipple
