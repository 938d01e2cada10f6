#pragma once

#include <cstdint>
#include <vector>

#include "splat/blend_backward.h"
#include "splat/cpu/tile_lists.h"

namespace stipple {

/// Sums of every visible splat over the tiles, double. Tiles hand in float sums per entry of their
/// list; each splat then adds its own in the order of the tiles, so no atomics are needed and the
/// result does not depend on the threads.
class BackwardSums {
 public:
  BackwardSums(size_t visible_count, BackwardMode mode);

  /// Adds tiles [first_tile, end_tile) of the group. In: tile_sums [entries of those
  /// tiles][fields].
  void add(const TileListGroup& group, size_t first_tile, size_t end_tile, const float* tile_sums);

  const double* of(size_t visible) const { return &sums_[visible * field_count_]; }

  /// Whether some sum is not 0: many splats in view are hidden by others.
  bool isTouched(size_t visible) const;

  static uint64_t memoryBound(uint64_t visible_count, BackwardMode mode);

 private:
  size_t visible_count_;
  size_t field_count_;
  std::vector<double> sums_;  ///< [visible][fields]
};

}  // namespace stipple
