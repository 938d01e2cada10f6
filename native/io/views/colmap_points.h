#pragma once

#include <string>

#include "data/meshes/point_set.h"

namespace stipple {

/// Reads points3D.bin, or points3D.txt, of a COLMAP model folder: positions, colours (scene linear)
/// and opacities of 1. A folder without either gives no points.
/// Errors: kIo, kFormat (with file and byte or line).
PointSet readColmapPoints(const std::string& folder);

}  // namespace stipple
