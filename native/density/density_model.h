#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/progress.h"
#include "density/sampling_tables.h"

namespace stipple {

constexpr int kMaxLeafLevel = 10;

/// The cube in the world that the octree divides. World = origin + side * u, u in [0,1]^3.
struct RootCube {
  std::array<double, 3> origin = {0, 0, 0};  ///< metres, lowest corner
  double side = 1.0;                         ///< metres
};

/// A probability density over the cells of an octree: an 8-way choice per cell.
class DensityModel {
 public:
  virtual ~DensityModel() = default;
  /// Level of the leaves, 1..kMaxLeafLevel (side 2^level cells).
  virtual int leafLevel() const = 0;
  virtual const RootCube& root() const = 0;
  /// Natural logarithms of the probabilities of the eight children of each cell. The sampler asks
  /// for questionCells() cells at once, so a call may be expensive.
  /// In: level of the parents (0 = root); cells: Morton codes at that level, ascending; progress: a
  /// model whose answer takes long asks it whether it is cancelled, and leaves its fraction alone.
  /// Out: out [cells.size(), 8], child k = dx + 2 dy + 4 dz; probability 0 is -inf.
  virtual void childLogProbabilities(int level, std::span<const uint64_t> cells,
                                     std::span<float> out, Progress* progress = nullptr) const = 0;
  /// How many cells the sampler shall ask for at once. Fewer where answers take long, so that
  /// progress is seen between them; each must still be worth what a question costs.
  virtual size_t questionCells() const { return 32768; }
  /// Bytes that an answer of that many cells holds at most beside itself, and what the first one
  /// leaves for the others.
  virtual uint64_t answerMemoryBound() const { return 0; }
  /// Leaves with mass; 0 where nobody has counted them.
  virtual size_t leafCount() const { return 0; }
  /// The same choices for the sampler to read without asking, where all of them are stored. They
  /// live as long as the model and stay as they are.
  virtual std::optional<OctreeTables> tables() const { return std::nullopt; }
};

}  // namespace stipple
