#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "density/density_model.h"

namespace stipple {

struct OctreeDensityOptions {
  int leaf_level = kMaxLeafLevel;  ///< 1..10; raising it follows the surface closer, costs memory
};

/// Sparse octree that stores log-probabilities; only cells with mass exist.
class OctreeDensity final : public DensityModel {
 public:
  /// Builds the density whose leaf masses are the summed weights of the points in them.
  /// In: positions [N,3] metres, N < 2^32; weights [N] >= 0, at least one positive, or empty for
  /// equal weights; the root cube is the bounding cube of the points, grown by 1 % of its side (a
  /// single point gives a cube of 1 mm).
  /// Errors: kInvalidArgument for no points, a negative or non-finite value, all weights 0.
  /// Threads and determinism: parallel; same result for any number of threads.
  /// Cost: O(N); about 30 bytes per point while it runs.
  static OctreeDensity fromPoints(std::span<const float> positions, std::span<const float> weights,
                                  const OctreeDensityOptions& options);
  /// The density from stored arrays (an asset file). In: per level 0..leaf_level-1 the cells and
  /// their child log-probabilities, as `cells` and `logProbabilities` return them.
  /// Errors: kInvalidArgument for a wrong number of levels or values, a root that is not a cube of
  /// finite size, a log-probability outside [-700, 1e-4] other than -inf, probabilities of a cell
  /// whose sum differs from 1 by more than 1e-4, cells that are not the children with mass, in
  /// order.
  static OctreeDensity fromLevels(const RootCube& root, std::vector<std::vector<uint64_t>> cells,
                                  std::vector<std::vector<float>> log_probabilities);

  int leafLevel() const override { return leaf_level_; }
  /// Cells without mass, stored or not, give eight times -inf.
  void childLogProbabilities(int level, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* progress = nullptr) const override;

  const RootCube& root() const override { return root_; }
  size_t leafCount() const override { return leaf_count_; }
  /// Parents at `level`, Morton-ordered.
  std::span<const uint64_t> cells(int level) const { return cells_[static_cast<size_t>(level)]; }
  /// [cells(level).size(), 8].
  std::span<const float> logProbabilities(int level) const {
    return log_probabilities_[static_cast<size_t>(level)];
  }

  /// None for a density that was never built.
  std::optional<OctreeTables> tables() const override;

 private:
  OctreeDensity finished() &&;

  RootCube root_;
  int leaf_level_ = 0;
  size_t leaf_count_ = 0;
  std::vector<std::vector<uint64_t>> cells_;
  std::vector<std::vector<float>> log_probabilities_;
  std::shared_ptr<const SamplingTables> tables_;  // immutable, shared by copies
};

}  // namespace stipple
