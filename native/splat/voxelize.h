#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/sparse_volume.h"
#include "splat/render.h"

namespace stipple {

struct VoxelizeOptions {
  double voxel_size = 0.0;  ///< metres; 0: from resolution
  uint32_t resolution =
      256;  ///< voxels along the longest side of the bounds, where voxel_size is 0
  /// Footprint: splats thinner than a voxel are widened to this share of the voxel size along the
  /// thin axis, keeping their optical depth. 0: no widening (tests of the formula).
  double low_pass = 0.5;
  double cut_off_sigma =
      4.0;                    ///< splats end at this Mahalanobis distance; <= 0: no cut-off (tests)
  double min_density = 1e-3;  ///< per metre; lower extinction is not stored
};

/// Splats → extinction and colour. Density: sum of sigma(x) = Li_1/2(o exp(-m^2/2)) /
/// (sqrt(2 pi) l_ref); colour: density-weighted, scene linear, of the degree-0 harmonics.
/// Multi-threaded, sparse: memory O(touched bricks). Same result for any number of threads.
/// Errors: kInvalidArgument (voxel size, no splats), kMemoryLimit when more than
/// memory_limit_bytes would be needed.
SparseVolume voxelize(std::span<const SplatInstance> instances, const VoxelizeOptions& options,
                      uint64_t memory_limit_bytes = UINT64_MAX, Progress* progress = nullptr);

/// Upper bound of the bytes that voxelize needs for these settings.
uint64_t voxelizeMemoryBound(std::span<const SplatInstance> instances,
                             const VoxelizeOptions& options);

}  // namespace stipple
