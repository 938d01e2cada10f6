#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/sparse_volume.h"
#include "splat/render/render.h"

namespace stipple {

struct VoxelizeOptions {
  double voxel_size = 0.0;  ///< metres; 0: from resolution
  /// Voxels along the longest side of the bounds, where voxel_size is 0.
  uint32_t resolution = 256;
  /// Axes thinner than this share of a voxel are widened to it. The shortest axis keeps the optical
  /// depth through its face; the other two keep opacity times area. 0: no widening (tests of the
  /// formula); then a splat with an axis of length 0 is refused.
  double low_pass = 0.5;
  /// Splats end at this Mahalanobis distance; <= 0: no cut-off (tests).
  double cut_off_sigma = 4.0;
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
