#pragma once

#include <string>
#include <vector>

#include "math/camera.h"

namespace stipple {

struct CameraView {
  Camera camera;
  std::string image_path;  ///< as in the file, relative to it; may be empty
};

/// Reads cameras of a transforms.json (nerfstudio, NeRF-synthetic; OpenGL frames become OpenCV).
/// Errors: kIo, kFormat (missing or wrong fields, distorted models), kUnsupported.
std::vector<CameraView> readCameraFile(const std::string& path);

}  // namespace stipple
