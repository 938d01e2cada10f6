#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// How many places lie in each cell of a grid of cubes.
class VoxelCounts {
 public:
  /// In: edge > 0, metres.
  explicit VoxelCounts(double edge) : edge_(edge) {}

  void add(const Vec3d& place) { cells_.push_back(cellOf(place)); }
  /// Call once, after the last place.
  void finish();
  /// In the cell of this place.
  size_t at(const Vec3d& place) const;

 private:
  /// 64 mixed bits of three indices; two cells share them with a probability of 2^-64.
  uint64_t cellOf(const Vec3d& place) const;

  double edge_;
  std::vector<uint64_t> cells_;  ///< rising after finish()
};

}  // namespace stipple
