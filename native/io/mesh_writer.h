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

/// Writes the glTF or GLB file `source`, which the mesh was read from, with the mesh's positions,
/// and its normals where the file has some, as a .glb. All else in the file stays: UVs, colours,
/// materials, pictures, nodes, skins and their weights, animations, and shape keys as differences
/// from the new shape. Tangents go, since they belong to the old one. Errors: kIo, kFormat;
/// kInvalidArgument for a mesh with another number of vertices or triangles; kUnsupported for
/// another extension, for a file that shows a mesh several times, and for one of 4 GiB and more;
/// kUnavailable (media library missing).
void writeReshapedMesh(const TriMesh& mesh, const std::string& source, const std::string& path);

}  // namespace stipple
