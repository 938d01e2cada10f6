#pragma once

#include <string>
#include <vector>

#include "io/views/camera_file.h"

namespace stipple {

/// A view of a data set and its files, which are there.
struct DatasetView {
  CameraView view;         ///< what the cameras' file says
  std::string image_path;  ///< absolute or from the working folder, as all of these
  std::string mask_path;   ///< may be empty
  std::string depth_path;  ///< may be empty
  /// It is one of the numbered frames that lie in the folder of its camera, which stands still.
  bool is_of_folder = false;
  /// Whose picture it is, where one camera took several: as series.h has it; else empty.
  std::string camera_name{};
};

/// The views of a data set whose images are there.
struct DatasetFiles {
  std::vector<DatasetView> views;
  std::vector<std::string> notes;  ///< what is missing, a sentence each
};

/// So many views a data set must have left where images are missing.
constexpr size_t kFewestViewsLeft = 3;

/// Finds the picture of every camera of a data set, and its mask: where the cameras' file names
/// one, or in a folder `masks` beside the pictures' folder, as NAME, NAME.png or with the extension
/// .png. Pictures of transforms.json may be named without their extension. Those of COLMAP are
/// looked for in `images` beside the model's folder and around it, and in these folders themselves.
/// Views whose image is missing are left out, as who culls photographs deletes them and leaves the
/// list of cameras as it was.
///
/// In: with_frames: where a camera's image is the only one that is listed of its folder, and its
/// file says no time, the other images of that folder which are called like it up to their number
/// are views of that camera, too (numbered_frames.h). Those of a poses_bounds.npy are as
/// findPoseBoundsFiles() has them.
/// Errors: those of readCameraFile(), numberedFrames() and findPoseBoundsFiles(); kIo where a mask
/// or a depth image that the file names is missing, or where missing images leave fewer than
/// kFewestViewsLeft views, with their number and the first of them.
DatasetFiles findDatasetFiles(const std::string& path, bool with_frames = false);

}  // namespace stipple
