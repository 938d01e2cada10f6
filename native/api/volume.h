#pragma once

#include <stipple/stipple.h>

#include "splat/voxels/voxelize.h"

namespace stipple::api {

/// In: the caller's, or NULL. Errors: kInvalidArgument.
VoxelizeOptions voxelizeOptionsFrom(const StippleVoxelizeOptions* options);

}  // namespace stipple::api
