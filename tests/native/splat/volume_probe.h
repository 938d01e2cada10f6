#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>

#include "data/sparse_volume.h"
#include "math/vec.h"

namespace stipple {

/// Reads a SparseVolume as a renderer does: trilinear between voxel centres, 0 outside.
class VolumeProbe {
 public:
  explicit VolumeProbe(const SparseVolume& volume) : volume_(volume) {
    for (size_t i = 0; i < volume.bricks.size(); ++i) index_[volume.bricks[i]] = i;
  }

  double voxel(int32_t x, int32_t y, int32_t z) const {
    const auto found = index_.find({x & ~7, y & ~7, z & ~7});
    if (found == index_.end()) return 0.0;
    const auto at = static_cast<size_t>(((x & 7) * 8 + (y & 7)) * 8 + (z & 7));
    return static_cast<double>(volume_.density[found->second * kBrickVoxelCount + at]);
  }

  double density(const Vec3d& point) const {
    const Vec3d grid = (point - Vec3d(volume_.origin[0], volume_.origin[1], volume_.origin[2])) /
                       volume_.voxel_size;
    const Vec3d low = grid.array().floor();
    const Vec3d f = grid - low;
    const auto x = static_cast<int32_t>(low[0]);
    const auto y = static_cast<int32_t>(low[1]);
    const auto z = static_cast<int32_t>(low[2]);
    double sum = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      const int dx = corner >> 2;
      const int dy = (corner >> 1) & 1;
      const int dz = corner & 1;
      const double weight =
          (dx ? f[0] : 1 - f[0]) * (dy ? f[1] : 1 - f[1]) * (dz ? f[2] : 1 - f[2]);
      if (weight > 0) sum += weight * voxel(x + dx, y + dy, z + dz);
    }
    return sum;
  }

  /// Optical depth along the unit direction through `point`, over `half_length` on both sides.
  /// Midpoint steps of 1/8 voxel: the interpolant is smooth between voxel planes, so the step
  /// error is below a hundredth of the interpolation error that the tests measure.
  double opticalDepth(const Vec3d& point, const Vec3d& direction, double half_length) const {
    const double step = volume_.voxel_size / 8.0;
    const auto count = static_cast<int64_t>(std::ceil(2.0 * half_length / step));
    double sum = 0.0;
    for (int64_t i = 0; i < count; ++i) {
      const double t = (static_cast<double>(i) + 0.5 - 0.5 * static_cast<double>(count)) * step;
      sum += density(point + direction * t);
    }
    return sum * step;
  }

  /// Sum of density times voxel volume, square metres.
  double mass() const {
    double sum = 0.0;
    for (const float value : volume_.density) sum += static_cast<double>(value);
    return sum * volume_.voxel_size * volume_.voxel_size * volume_.voxel_size;
  }

 private:
  const SparseVolume& volume_;
  std::map<std::array<int32_t, 3>, size_t> index_;
};

}  // namespace stipple
