#pragma once

#include <string>
#include <vector>

#include "math/camera.h"

namespace stipple {

struct CameraView {
  Camera camera;
  std::string image_path;  ///< as in the file, relative to it; may be empty
};

/// Reads cameras of a transforms.json (nerfstudio, NeRF-synthetic; OpenGL frames become OpenCV) or
/// of a COLMAP model (binary or text; pinhole cameras). In: path, the file, or a folder: its
/// transforms.json where there is one, else the COLMAP model in it or in its sparse/0.
///
/// In a transforms.json keys of a frame win over those of the file. Besides perspective cameras it
/// knows ours: `"camera_model": "ORTHOGRAPHIC"` with `"ortho_scale"`, the metres across the
/// picture's width.
///
/// A file without `w` and `h` (NeRF-synthetic) gives cameras of width and height 0, whose
/// intrinsics are in units of the picture: fx = fy = 0.5 / tan(angle / 2), the focal length in
/// widths (orthographic: 1 / ortho_scale, widths per metre), cx = cy = 0.5 of width and height.
/// For a picture of w x h pixels: fx, fy and cx times w, cy times h.
/// Errors: kIo, kFormat (missing or wrong fields, with the frame), kUnsupported (distorted models).
std::vector<CameraView> readCameraFile(const std::string& path);

}  // namespace stipple
