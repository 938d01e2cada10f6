#pragma once

#include <cstdint>
#include <span>

#include "splat/voxelize_bricks.h"

namespace stipple {

/// Extinction and extinction-weighted mean colour of the voxels of one brick, summed in the order
/// of `list`. In: list: indices into splats. Out: density [512] per metre, colour [512,3] (0 where
/// no splat reaches). Runs on the widest vectors of the machine; polylogHalf's relative error of
/// the kernel is below 1e-5.
void sumBrick(const BrickKey& brick, std::span<const VoxelSplat> splats,
              std::span<const uint32_t> list, float* density, float* colour);

}  // namespace stipple
