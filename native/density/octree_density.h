#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "density/density_model.h"

namespace stipple {

constexpr int kMaxLeafLevel = 10;

/// The cube in the world that the octree divides. World = origin + side * u, u in [0,1]^3.
struct RootCube {
  std::array<double, 3> origin = {0, 0, 0};  ///< metres, lowest corner
  double side = 1.0;                         ///< metres
};

struct OctreeDensityOptions {
  int leaf_level = kMaxLeafLevel;  ///< 1..10; raising it follows the surface closer, costs memory
};

/// Sparse octree that stores log-probabilities; only cells with mass exist.
class OctreeDensity final : public DensityModel {
 public:
  /// Builds the density whose leaf masses are the summed weights of the points in them.
  /// In: positions [N,3] metres; weights [N] >= 0, at least one positive; the root cube is the
  /// bounding cube of the points, grown by 1 % of its side (a single point gives a cube of 1 mm).
  /// Errors: kInvalidArgument for no points, a negative or non-finite value, all weights 0.
  static OctreeDensity fromPoints(std::span<const float> positions, std::span<const float> weights,
                                  const OctreeDensityOptions& options);
  /// The density from stored arrays (an asset file). In: per level 0..leaf_level-1 the cells and
  /// their child log-probabilities, as `cells` and `logProbabilities` return them.
  static OctreeDensity fromLevels(const RootCube& root, std::vector<std::vector<uint64_t>> cells,
                                  std::vector<std::vector<float>> log_probabilities);

  int leafLevel() const override { return leaf_level_; }
  void childLogProbabilities(int level, std::span<const uint64_t> cells,
                             std::span<float> out) const override;

  const RootCube& root() const { return root_; }
  size_t leafCount() const { return leaf_count_; }
  /// Parents at `level`, Morton-ordered.
  std::span<const uint64_t> cells(int level) const { return cells_[static_cast<size_t>(level)]; }
  /// [cells(level).size(), 8].
  std::span<const float> logProbabilities(int level) const {
    return log_probabilities_[static_cast<size_t>(level)];
  }

 private:
  RootCube root_;
  int leaf_level_ = 0;
  size_t leaf_count_ = 0;
  std::vector<std::vector<uint64_t>> cells_;
  std::vector<std::vector<float>> log_probabilities_;
};

}  // namespace stipple
