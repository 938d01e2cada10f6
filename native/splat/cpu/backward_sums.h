#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "splat/cpu/reused_array.h"
#include "splat/cpu/tiles/tile_lists.h"
#include "splat/render/blend_backward.h"

namespace stipple {

/// What tiles hand in: float32 sums per entry of their lists.
struct TileSums {
  size_t first_tile, end_tile;
  const float* values;   ///< [entries of those tiles][fields]
  const uint32_t* used;  ///< [tiles of the picture] entries from there on have none
};

/// Sums of every splat over the tiles, by its slot. Each splat walks its own entries in the order
/// of the tiles, as they were listed, so no atomics are needed and the result does not depend on
/// the threads. They are summed in double and stored in float32, a cache line each: splats come in
/// the order of depth, so slots are random and lines are what they cost.
class BackwardSums {
 public:
  /// For this many slots, in memory that may hold an earlier picture's.
  void reset(size_t slot_count, BackwardWants wants);

  /// Adds some tiles of the group that `lists` holds.
  void add(const VisibleSplats& visible, const TileGrid& grid, const TileListMemory& lists,
           const TileSums& tiles);

  /// Sums of a splat; they have a meaning where it is touched.
  const float* of(size_t slot) const { return sums_.get() + slot * stride_; }

  /// Whether a tile handed in a sum that is not 0: many splats in view are hidden by others.
  bool isTouched(size_t slot) const { return touched_[slot] != 0; }

  size_t fieldCount() const { return field_count_; }
  size_t stride() const { return stride_; }

  static uint64_t memoryBound(uint64_t splat_count, const TileGrid& grid, BackwardWants wants);

 private:
  template <size_t kFieldCount>
  void addFields(const VisibleSplats& visible, const TileGrid& grid, const TileListMemory& lists,
                 const TileSums& tiles);

  /// In: sums [fields], held to float32.
  template <size_t kFieldCount>
  void storeSums(size_t slot, bool is_first, double* sums);

  size_t field_count_ = 0;
  size_t stride_ = 0;
  ReusedArray<float> sums_;        ///< [slots][stride]
  ReusedArray<uint8_t> touched_;   ///< [slots]
  std::vector<uint64_t> cursors_;  ///< [chunk][tile]
  std::vector<uint64_t> ends_;     ///< [tile] behind the last entry that has sums
};

}  // namespace stipple
