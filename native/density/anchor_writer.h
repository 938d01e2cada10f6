#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/random.h"
#include "density/anchor_sampling.h"
#include "density/child_splits.h"
#include "math/morton.h"

namespace stipple {

/// Writes the anchors of leaves into their places in an AnchorSet; threads may write disjoint
/// places at once. Positions are multiples of 2^-24, which float32 holds exactly below 1: no
/// rounding can move an anchor out of its leaf or to 1.
class AnchorWriter {
 public:
  AnchorWriter(AnchorSet& set, uint64_t seed)
      : positions_(set.positions.data()),
        log_q_(set.log_q.data()),
        leaves_(set.leaves.data()),
        level_(set.leaf_level),
        fraction_bits_(24 - set.leaf_level),
        base_(mixBits(seed ^ static_cast<uint64_t>(RandomUse::kLeafJitter) << 56)) {}

  /// Anchors first..first+count-1 of `leaf` at `place` onwards, uniform in the leaf, keyed by
  /// (seed, leaf, index in leaf): an anchor keeps its position whatever the budget.
  void write(uint64_t leaf, float log_q, uint32_t first, uint32_t count, size_t place) const {
    const auto [x, y, z] = mortonDecode(leaf);
    const uint32_t low_x = x << fraction_bits_;
    const uint32_t low_y = y << fraction_bits_;
    const uint32_t low_z = z << fraction_bits_;
    const uint64_t index = cellKey(level_, leaf) << 28 | first;
    for (uint32_t j = 0; j < count; ++j) {
      // The same as keyedBits(seed, kLeafJitter, index): 21 bits for each axis, one bit is left.
      const uint64_t bits = mixBits(base_ ^ (index + j));
      float* position = positions_ + 3 * (place + j);
      position[0] = onGrid(low_x | fraction(static_cast<uint32_t>(bits)));
      position[1] = onGrid(low_y | fraction(static_cast<uint32_t>(bits >> 21)));
      position[2] = onGrid(low_z | fraction(static_cast<uint32_t>(bits >> 42)));
      log_q_[place + j] = log_q;
      leaves_[place + j] = leaf;
    }
  }

  /// One anchor at the fractions u of its leaf. In: u [3], each in [0, 1).
  void writeAt(uint64_t leaf, float log_q, const double* u, size_t place) const {
    const auto coordinates = mortonDecode(leaf);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double steps = std::floor(u[axis] * static_cast<double>(1u << fraction_bits_));
      positions_[3 * place + axis] =
          onGrid(coordinates[axis] << fraction_bits_ | static_cast<uint32_t>(steps));
    }
    log_q_[place] = log_q;
    leaves_[place] = leaf;
  }

 private:
  uint32_t fraction(uint32_t bits) const { return (bits & 0x1fffff) << 3 >> level_; }
  static float onGrid(uint32_t steps) {
    return static_cast<float>(static_cast<int32_t>(steps)) * 0x1.0p-24f;
  }

  float* positions_;
  float* log_q_;
  uint64_t* leaves_;
  int level_;
  int fraction_bits_;
  uint64_t base_;
};

}  // namespace stipple
