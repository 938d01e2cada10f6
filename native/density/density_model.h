#pragma once

#include <cstdint>
#include <span>

namespace stipple {

/// A probability density over the cells of an octree: an 8-way choice per cell.
class DensityModel {
 public:
  virtual ~DensityModel() = default;
  /// Level of the leaves, 1..10 (side 2^level cells).
  virtual int leafLevel() const = 0;
  /// Natural logarithms of the probabilities of the eight children of each cell.
  /// In: level of the parents (0 = root); cells: Morton codes at that level, ascending.
  /// Out: out [cells.size(), 8], child k = dx + 2 dy + 4 dz; probability 0 is -inf.
  virtual void childLogProbabilities(int level, std::span<const uint64_t> cells,
                                     std::span<float> out) const = 0;
};

}  // namespace stipple
