#pragma once

#include <string>

#include "data/meshes/point_set.h"

namespace stipple {

/// Reads the vertices of a PLY file as points: x y z, and red green blue where they are there (8 or
/// 16 bits or float, display values; grey without), and time where it is there (seconds). Opacities
/// are 1. In: with_normals: nx ny nz are read as well, where all three are there, as they are;
/// else normals are left out. Errors: kIo, kFormat with the property or the vertex.
PointSet readPlyPoints(const std::string& path, bool with_normals = false);

}  // namespace stipple
