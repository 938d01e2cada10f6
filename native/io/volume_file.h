#pragma once

#include <string>

#include "data/sparse_volume.h"

namespace stipple {

/// Writes an OpenVDB file with the float grid `density` (fog volume) and the vec3 grid `color`.
/// Errors: kIo, kUnavailable (media library missing).
void writeVolumeFile(const SparseVolume& volume, const std::string& path);

/// Reads the same two grids back. Errors: kIo, kFormat, kUnavailable.
SparseVolume readVolumeFile(const std::string& path);

}  // namespace stipple
