#include "densify/quantities/voxel_counts.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace stipple {

void VoxelCounts::finish() {
  std::sort(cells_.begin(), cells_.end());
}

size_t VoxelCounts::at(const Vec3d& place) const {
  const auto [first, last] = std::equal_range(cells_.begin(), cells_.end(), cellOf(place));
  return static_cast<size_t>(last - first);
}

uint64_t VoxelCounts::cellOf(const Vec3d& place) const {
  // Indices beyond this are of places so far away that float32 cannot tell cells apart.
  constexpr double kFarthest = 4e18;
  uint64_t bits = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double index = std::clamp(std::floor(place[axis] / edge_), -kFarthest, kFarthest);
    bits = mixBits(bits ^ static_cast<uint64_t>(static_cast<int64_t>(index)));
  }
  return bits;
}

}  // namespace stipple
