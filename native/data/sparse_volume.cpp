#include "data/sparse_volume.h"

#include <algorithm>
#include <cmath>

namespace stipple {

VolumeExtent extentOf(const SparseVolume& volume) {
  VolumeExtent extent;
  for (const float density : volume.density) {
    if (density > 0) ++extent.active_voxel_count;
    extent.max_density = std::max(extent.max_density, static_cast<double>(density));
  }
  for (size_t b = 0; b < volume.bricks.size(); ++b) {
    for (size_t axis = 0; axis < 3; ++axis) {
      // Half a voxel beyond the centres of the first and last voxel of the brick.
      const double low = volume.origin[axis] + volume.voxel_size * (volume.bricks[b][axis] - 0.5);
      const double high = low + volume.voxel_size * kBrickSide;
      extent.lowest[axis] = b == 0 ? low : std::min(extent.lowest[axis], low);
      extent.highest[axis] = b == 0 ? high : std::max(extent.highest[axis], high);
    }
  }
  return extent;
}

double densityOfOpacity(double opacity, double length) {
  return -std::log1p(-opacity) / length;
}

}  // namespace stipple
