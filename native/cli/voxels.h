#pragma once

#include <cstdint>

#include "cli/library.h"

namespace stipple::cli {

/// Options of a voxelisation as they were typed. Throws Failure for a resolution out of range.
StippleVoxelizeOptions voxelizeOptions(double voxel_size, int64_t resolution);

/// The voxels of splats where their file has them; shows progress.
Volume voxelized(const Context& context, const Cloud& cloud, const StippleVoxelizeOptions& options);

}  // namespace stipple::cli
