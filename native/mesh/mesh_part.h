#pragma once

#include <cstdint>

#include "data/meshes/tri_mesh.h"
#include "math/vec.h"

namespace stipple {

/// Triangles of one object (or one instance of it), as arrays of the caller.
struct MeshPart {
  uint64_t vertex_count = 0;
  uint64_t triangle_count = 0;
  const float* positions = nullptr;              ///< [V,3] object space, metres
  const uint32_t* triangles = nullptr;           ///< [T,3] vertex indices
  const float* corner_normals = nullptr;         ///< [T,3,3] object space, or null: face normals
  const float* corner_uvs = nullptr;             ///< [T,3,2] or null
  const float* corner_colours = nullptr;         ///< [T,3,4] scene linear, or null
  const uint32_t* triangle_materials = nullptr;  ///< [T] of the mesh's materials; null: grey
  Mat4d object_to_world = Mat4d::Identity();     ///< affine, invertible
};

/// Refuses what the part lacks or points outside of, seen from the mesh that it is to join:
/// non-finite values, vertex or material indices out of range, UVs or colours that a material needs
/// and the part lacks, a matrix that validateAffine refuses. Errors: kInvalidArgument.
void validate(const MeshPart& part, const TriMesh& mesh);

/// Appends a valid part, placed in the world. Same result for any number of threads.
void appendPart(TriMesh& mesh, const MeshPart& part);

}  // namespace stipple
