#include <cmath>

#include "splat/voxels/voxelize_kernel.h"
#include "splat/voxels/voxelize_polylog.h"

namespace stipple {

namespace {

// Mean extinction over the samples of the voxel at `offset` from the splat's centre, in voxels.
double meanExtinction(const VoxelSplat& splat, const Vec3d& offset) {
  const Vec3d middle = splat.to_unit * offset;
  const Vec3d width = splat.to_unit.rowwise().norm();
  double sum = 0.0;
  for (int a = 0; a < splat.samples[0]; ++a) {
    for (int b = 0; b < splat.samples[1]; ++b) {
      for (int c = 0; c < splat.samples[2]; ++c) {
        const Vec3d place((a + 0.5) / splat.samples[0] - 0.5, (b + 0.5) / splat.samples[1] - 0.5,
                          (c + 0.5) / splat.samples[2] - 0.5);
        const double distance2 = (middle + place.cwiseProduct(width)).squaredNorm();
        if (distance2 > splat.reach * splat.reach) continue;
        sum +=
            polylogHalf(std::exp(-0.5 * distance2 - static_cast<double>(splat.minus_log_opacity)));
      }
    }
  }
  const int count = splat.samples[0] * splat.samples[1] * splat.samples[2];
  return static_cast<double>(splat.amplitude) * sum / count;
}

}  // namespace

void sumBrickScalar(const BrickKey& brick, const VoxelSplat* splats, const uint32_t* list,
                    size_t count, BrickSums& sums) {
  for (size_t voxel = 0; voxel < kBrickVoxelCount; ++voxel) {
    const auto at = static_cast<int>(voxel);
    const Vec3d place(brick[0] * double{kBrickSide} + at / 64,
                      brick[1] * double{kBrickSide} + at / 8 % 8,
                      brick[2] * double{kBrickSide} + at % 8);
    for (size_t i = 0; i < count; ++i) {
      const VoxelSplat& splat = splats[list[i]];
      const double sigma = meanExtinction(splat, place - splat.centre);
      sums[0][voxel] += sigma;
      for (size_t channel = 0; channel < 3; ++channel) {
        sums[channel + 1][voxel] += sigma * static_cast<double>(splat.colour[channel]);
      }
    }
  }
}

}  // namespace stipple
