#pragma once

#include <string>
#include <vector>

#include "io/views/camera_file.h"

namespace stipple {

constexpr const char* kPoseBoundsName = "poses_bounds.npy";

/// Reads the cameras of a poses_bounds.npy, as LLFF and sets of several videos (Neural 3D Video)
/// have it: [N,17] floats, of each camera [3,5] from camera to world and the nearest and farthest
/// depth. The columns of the former are the directions down, right and backwards, the place, and
/// (height, width, focal length) in pixels; the axis is in the middle of the picture. Images are
/// not named: image_path stays empty. Errors: those of readNpyArray(); kFormat for another shape,
/// and, with the camera's number, for numbers that are not finite, for what is no rotation, and for
/// sizes and focal lengths that no camera has. The depths are not used.
std::vector<CameraView> readPoseBounds(const std::string& path);

}  // namespace stipple
