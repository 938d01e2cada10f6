#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "data/views/view_source.h"
#include "math/camera.h"
#include "math/lens.h"

namespace stipple {

struct CameraView {
  Camera camera;               ///< without the lens
  std::string image_path;      ///< as in the file, relative to it; may be empty
  Lens lens = {};              ///< what the picture was taken through
  std::string camera_model{};  ///< as the file calls it
  std::string mask_path{};     ///< as image_path
  std::string depth_path{};    ///< as image_path
  ViewRole role = ViewRole::kNone;
  double time = 0;                  ///< when the picture was taken, seconds
  bool has_time = false;            ///< the file says it
  std::optional<uint64_t> frame{};  ///< its number, where the file says that
};

/// Cameras whose lens is not a pinhole's.
enum class Distorted { kRefuse, kKeep };

/// Reads cameras of a transforms.json (nerfstudio, NeRF-synthetic; OpenGL frames become OpenCV), of
/// a COLMAP model (binary or text), or of a poses_bounds.npy (pose_bounds.h). In: path, the file,
/// or a folder: its transforms.json where there is one, else transforms_train.json with _test and
/// _val, else the COLMAP model in it or in its sparse/0, else its poses_bounds.npy.
///
/// In a transforms.json keys of a frame win over those of the file. Besides perspective cameras it
/// knows ours: `"camera_model": "ORTHOGRAPHIC"` with `"ortho_scale"`, the metres across the
/// picture's width.
///
/// A frame's `time`, or `timestamp`, is when its picture was taken, in seconds (D-NeRF has it from
/// 0 to 1); `timestep_index` is the number of its frame.
///
/// A file without `w` and `h` (NeRF-synthetic) gives cameras of width and height 0, whose
/// intrinsics are in units of the picture: fx = fy = 0.5 / tan(angle / 2), the focal length in
/// widths (orthographic: 1 / ortho_scale, widths per metre), cx = cy = 0.5 of width and height.
/// For a picture of w x h pixels: fx, fy and cx times w, cy times h.
/// Errors: kIo, kFormat (missing or wrong fields, with the frame), kUnsupported (models that are
/// not known; distorted ones where they are refused).
std::vector<CameraView> readCameraFile(const std::string& path,
                                       Distorted distorted = Distorted::kRefuse);

/// Where the pictures and points of a data set are listed.
struct CameraFiles {
  std::vector<std::string> transforms;  ///< transforms*.json
  std::string colmap;                   ///< or the folder of a COLMAP model
  std::string pose_bounds;              ///< or a poses_bounds.npy
};

/// What readCameraFile() reads for a path. A folder with transforms_train.json, and without
/// transforms.json, gives that and its _test and _val (NeRF-synthetic), whose views are told apart
/// by CameraView::role. Errors: kFormat for a folder without any.
CameraFiles findCameraFiles(const std::string& path);

/// `ply_file_path` of a transforms.json, the points of its scene; empty where it names none.
std::string readPointsPath(const std::string& transforms);

}  // namespace stipple
