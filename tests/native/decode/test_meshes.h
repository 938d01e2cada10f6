#pragma once

#include <array>
#include <string>

#include "data/meshes/tri_mesh.h"
#include "math/vec.h"

namespace stipple::test {

/// Grey meshes of one material, without corner attributes unless said otherwise.
TriMesh uvSphere(double radius, const Vec3d& centre, int rings, int segments);
TriMesh cube(double side, const Vec3d& centre);
/// A square of side x side in z = height(x, y), cells x cells quads, open borders.
TriMesh terrain(double side, int cells, double amplitude, const Vec3d& centre);
TriMesh torus(double major, double minor, int rings, int segments);
/// Triangles of an OBJ file with v and f lines only, with smooth corner normals.
TriMesh loadObj(const std::string& path);
/// Both meshes as one; materials are those of the first.
TriMesh joined(TriMesh first, const TriMesh& second);
/// Corner normals as area-weighted means over the faces at a vertex.
void smoothNormals(TriMesh& mesh);

}  // namespace stipple::test
