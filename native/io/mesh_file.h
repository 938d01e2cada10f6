#pragma once

#include <string>

#include "data/meshes/tri_mesh.h"

namespace stipple {

/// Reads the triangles of a glTF or GLB file: node transforms applied, Y up turned to Z up,
/// textures, vertex colours and base colour factors as materials. Errors: kIo, kFormat (a mesh that
/// validateArrays() refuses too), kUnavailable (media library missing).
TriMesh readMeshFile(const std::string& path);

}  // namespace stipple
