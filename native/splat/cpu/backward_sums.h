#pragma once

#include <cstdint>

#include "splat/blend_backward.h"
#include "splat/cpu/reused_array.h"
#include "splat/cpu/tile_lists.h"

namespace stipple {

/// Sums of every visible splat over the tiles, double. Tiles hand in float sums per entry of their
/// list; each splat then adds its own in the order of the tiles, so no atomics are needed and the
/// result does not depend on the threads.
class BackwardSums {
 public:
  /// Zeros for this many splats, in memory that may hold an earlier picture's.
  void reset(size_t visible_count, BackwardMode mode);

  /// Adds tiles [first_tile, end_tile) of the group. In: tile_sums [entries of those
  /// tiles][fields].
  void add(const TileListGroup& group, size_t first_tile, size_t end_tile, const float* tile_sums);

  const double* of(size_t visible) const { return sums_.get() + visible * field_count_; }

  /// Whether some sum is not 0: many splats in view are hidden by others.
  bool isTouched(size_t visible) const;

  uint64_t bytes() const { return sums_.bytes(); }

  static uint64_t memoryBound(uint64_t visible_count, BackwardMode mode);

 private:
  size_t visible_count_ = 0;
  size_t field_count_ = 0;
  ReusedArray<double> sums_;  ///< [visible][fields]
};

}  // namespace stipple
