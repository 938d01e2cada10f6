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
  double voxel_size = 0.0;                     ///< metres
  std::array<double, 3> origin = {0, 0, 0};    ///< metres, centre of voxel (0,0,0)
  std::vector<std::array<int32_t, 3>> bricks;  ///< [B] first voxel of the brick, multiples of 8
  std::vector<float> density;                  ///< [B,512] extinction per metre
  std::vector<float> colour;                   ///< [B,512,3] scene linear

  size_t brickCount() const { return bricks.size(); }
};

/// Where a volume lies, and what it holds.
struct VolumeExtent {
  uint64_t active_voxel_count = 0;           ///< whose density is above 0
  double max_density = 0;                    ///< per metre
  std::array<double, 3> lowest = {0, 0, 0};  ///< metres, of the bricks; 0 without any
  std::array<double, 3> highest = {0, 0, 0};
};
VolumeExtent extentOf(const SparseVolume& volume);

/// The density, per metre, of what stops the share `opacity` of the light over `length` metres.
double densityOfOpacity(double opacity, double length);

}  // namespace stipple
