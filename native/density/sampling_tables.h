#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// What sampling an octree reads, computed once: the same numbers that child_splits.h gives for
/// the stored log-probabilities, packed without the children that have no mass.
/// Memory: about 45 bytes per leaf of a surface.
struct SamplingTables {
  /// Child c of level l is cell c of level l + 1: both lists hold the cells with mass in order.
  struct Level {
    std::vector<uint32_t> first_child;  ///< [cells + 1]
    std::vector<double> shares;         ///< [children] cumulativeShares within the parent
  };
  struct Leaf {
    uint32_t code;  ///< Morton code at the leaf level
    float log_q;
  };
  /// A binary split with mass on both sides, over leaves a..b-1 with b - a >= 2. Stored in preorder
  /// without the leaves: the split of the lower half is the next one (where that half has two
  /// leaves or more), that of the upper half comes lower_leaves further on.
  struct Split {
    uint32_t share;         ///< upperShare, 1..2^32 - 1
    uint32_t key;           ///< key of the split's number: a leading one, then the path, bit by bit
    uint32_t lower_leaves;  ///< leaves in the lower half
  };

  std::vector<Level> levels;  ///< [leaf level]
  std::vector<Leaf> leaves;
  std::vector<Split> splits;  ///< [leaves - 1]
};

/// What sampling reads of an octree whose choices are all stored.
struct OctreeTables {
  std::span<const std::vector<uint64_t>> cells;  ///< [leaf level], Morton codes
  const SamplingTables& tables;
};

/// In: per level the cells and [cells, 8] log-probabilities; already checked. Parallel.
SamplingTables makeSamplingTables(std::span<const std::vector<uint64_t>> cells,
                                  std::span<const std::vector<float>> log_probabilities);

}  // namespace stipple
