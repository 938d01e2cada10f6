#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "math/vec.h"
#include "splat/voxels/voxelize.h"

namespace stipple {

/// Largest opacity that has a finite optical depth through the centre.
constexpr double kVoxelMaxOpacity = 0.99;

/// Most samples that one voxel takes along the axes of a splat, thinnest axis first.
constexpr uint8_t kVoxelMaxSamples[3] = {8, 4, 2};

/// One splat on the grid; lengths in voxels, positions as voxel indices.
struct VoxelSplat {
  Vec3d centre;
  /// Rows: the principal axes, shortest first, over their standard deviations; |to_unit x| is the
  /// Mahalanobis distance.
  Mat3d to_unit;
  Vec3d half_extent;   ///< of the box around everything the splat reaches
  double reach = 0.0;  ///< Mahalanobis distance at which the splat ends
  float minus_log_opacity = 0.0f;
  float amplitude = 0.0f;  ///< 1 / (sqrt(2 pi) l_ref), per metre
  float colour[3] = {0, 0, 0};
  /// Samples of one voxel along each principal axis, spread evenly over one voxel width.
  uint8_t samples[3] = {1, 1, 1};
};

/// Checks options and instances and returns the voxel size in metres.
/// Errors: kInvalidArgument as voxelize.
double chooseVoxelSize(std::span<const SplatInstance> instances, const VoxelizeOptions& options);

/// Reads the instances onto the grid. Splats that contribute nothing (opacity 0, no area, below
/// the floor of min_density) are left out; the others keep their order.
/// In: voxel_size from chooseVoxelSize. Errors: kInvalidArgument as voxelize.
std::vector<VoxelSplat> prepareVoxelSplats(std::span<const SplatInstance> instances,
                                           const VoxelizeOptions& options, double voxel_size,
                                           Progress* progress);

}  // namespace stipple
