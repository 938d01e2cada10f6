#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/voxels/voxelize_bricks.h"

namespace stipple {

/// Sums of one brick's voxels: extinction per metre, then red, green and blue times extinction.
using BrickSums = std::array<std::array<double, kBrickVoxelCount>, 4>;

/// Adds the splats of list [count], indices into splats, to the sums of a brick, in this order.
using BrickKernel = void (*)(const BrickKey& brick, const VoxelSplat* splats, const uint32_t* list,
                             size_t count, BrickSums& sums);

struct NamedBrickKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  BrickKernel kernel;
};

/// The kernel to use: the best for this processor, or the one that the environment variable
/// STIPPLE_FORCE_TARGET names when it is first asked for (upper or lower case). Errors:
/// kInvalidArgument where that names no kernel of brickKernels().
BrickKernel chosenBrickKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<NamedBrickKernel> brickKernels();

/// The plain kernel: the formula in double.
void sumBrickScalar(const BrickKey& brick, const VoxelSplat* splats, const uint32_t* list,
                    size_t count, BrickSums& sums);

}  // namespace stipple
