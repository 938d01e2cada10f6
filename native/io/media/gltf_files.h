#pragma once

#include "io/media/gltf_model.h"

namespace stipple::media {

/// Has the files that a glTF file names by uri read as ours are: folders, pipes and devices are
/// refused, where tinygltf would wait for a pipe's writer.
void readRegularFilesOnly(tinygltf::TinyGLTF& loader);

}  // namespace stipple::media
