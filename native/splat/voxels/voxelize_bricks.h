#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "splat/voxels/voxelize_splat.h"

namespace stipple {

/// Brick coordinates: voxel index divided by 8, rounded down.
using BrickKey = std::array<int32_t, 3>;

/// Which splats reach which bricks.
struct BrickTable {
  std::vector<BrickKey> keys;     ///< [B] by x, then y, then z
  std::vector<uint64_t> offsets;  ///< [B+1] into splats
  std::vector<uint32_t> splats;   ///< growing inside each brick
};

/// A number of (brick, splat) pairs that is surely needed, in closed form: no walk over bricks, so
/// it answers for any voxel size. `bricks` receives the same for the bricks of the largest splat.
double leastPairCount(std::span<const VoxelSplat> splats, double& bricks);

/// The bricks that at least one splat reaches, sorted, and the number of (brick, splat) pairs.
/// Errors: kMemoryLimit when the list alone passes limit_bytes.
std::vector<BrickKey> findBricks(std::span<const VoxelSplat> splats, uint64_t limit_bytes,
                                 uint64_t& pair_count, Progress* progress);

/// Up to so many bricks, fillBricks takes up to 4 more bytes a splat for a while.
inline constexpr size_t kFewBricks = 1024;

/// Lists the splats of every brick. In: keys from findBricks. Same lists for any thread count.
BrickTable fillBricks(std::span<const VoxelSplat> splats, std::vector<BrickKey> keys,
                      Progress* progress);

}  // namespace stipple
