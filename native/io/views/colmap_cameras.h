#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/views/camera_file.h"

namespace stipple {

/// The folder of a COLMAP model that `path` means, or nothing: the folder itself, its `sparse/0`,
/// `sparse` or `colmap/sparse/0`; for a file cameras.bin, images.bin (or .txt) the folder around
/// it.
std::optional<std::string> findColmapModel(const std::string& path);

/// Reads cameras.* and images.* of a COLMAP model folder, binary where both images.bin and
/// images.txt are there. Views are sorted by the picture's name, which is the order that trainers
/// split them in; the world is COLMAP's own.
/// Errors: kIo, kFormat (with file and byte or line), kUnsupported (unknown models, by name;
/// distorted ones where they are refused).
std::vector<CameraView> readColmapCameras(const std::string& folder, Distorted distorted);

}  // namespace stipple
