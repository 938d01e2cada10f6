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
};

/// Finds the picture of every camera of a data set, and its mask: where the cameras' file names
/// one, or in a folder `masks` beside the pictures' folder, as NAME, NAME.png or with the ending
/// .png. Pictures of transforms.json may be named without their ending. Those of COLMAP are looked
/// for in `images` beside the model's folder and around it, and in these folders themselves.
/// Errors: those of readCameraFile(); kIo where pictures are missing, with their number and the
/// first of them.
std::vector<DatasetView> findDatasetViews(const std::string& path);

}  // namespace stipple
