#pragma once

#include <string>

#include "io/views/dataset_files.h"

namespace stipple {

/// The views of a set of several videos (Neural 3D Video): a poses_bounds.npy beside a folder of
/// numbered images for each of its cameras. The folders are those whose names begin with "cam", and
/// where none is, all that hold numbered images; by name, they are the rows of the file. Images lie
/// in the folder itself or in its `images`. Their size may differ from what the file says by one
/// factor, by which its focal lengths are multiplied then.
///
/// In: bounds, the file; with_frames: all frames; else each camera's first.
/// Errors: those of readPoseBounds(); kFormat where folders are not as many as cameras, where one
/// holds no numbered images, and where sizes are not in proportion; kUnsupported where there are
/// videos alone, with what makes images of them.
DatasetFiles findPoseBoundsFiles(const std::string& bounds, bool with_frames);

}  // namespace stipple
