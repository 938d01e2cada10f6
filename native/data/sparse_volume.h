#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

constexpr int kBrickSide = 8;
constexpr int kBrickVoxelCount = kBrickSide * kBrickSide * kBrickSide;

/// A sparse grid of 8^3 bricks. Voxel (i, j, k) has its centre at origin + voxel_size*(i, j, k).
/// Inside a brick the index is (x * 8 + y) * 8 + z, as in an OpenVDB leaf. Bricks are sorted by
/// coordinate (x, then y, then z).
struct SparseVolume {
  double voxel_size = 0.0;                    ///< metres
  std::array<double, 3> origin = {0, 0, 0};   ///< metres, centre of voxel (0,0,0)
  std::vector<std::array<int32_t, 3>> bricks;  ///< [B] first voxel of the brick, multiples of 8
  std::vector<float> density;                 ///< [B,512] extinction per metre
  std::vector<float> colour;                  ///< [B,512,3] scene linear

  size_t brickCount() const { return bricks.size(); }
};

}  // namespace stipple
