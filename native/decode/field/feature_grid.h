#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Feature vectors at the corners of an octree level's cells. Corners share a table: each has a row
/// of its own where all fit, else the row that a hash of its coordinates gives.
struct FeatureLevel {
  int level = 0;              ///< 2^level cells a side
  uint32_t row_count = 0;     ///< a power of two, at least 8, where hashed
  std::vector<float> values;  ///< [rows, channels]
};

/// Derivatives by some rows of a level. Rows that are not listed have none.
struct FeatureGradient {
  std::vector<uint32_t> rows;   ///< in the order of their first use
  std::vector<float> values;    ///< [level's rows, channels]; zeros where not listed
  std::vector<uint8_t> listed;  ///< [level's rows]

  void clear(size_t channels);  ///< costs as much as rows are listed
};

/// Where features are read.
struct FeaturePlaces {
  std::span<const float> positions;  ///< [N,3] in the unit cube; held to it
  /// [N] > 0, side of what a place stands for, unit cube: levels that are finer than that count
  /// less, by 1 / sqrt(1 + 1.25 (footprint / cell)^2), as they would only add noise.
  std::span<const float> footprints;

  size_t size() const { return footprints.size(); }
};

/// Features on octree levels, trilinear within each cell.
/// Based on: Mueller, Evans, Schied, Keller, Instant Neural Graphics Primitives, SIGGRAPH 2022
/// (hashed tables per level); Barron and others, Zip-NeRF, ICCV 2023 (levels weighted by scale).
class FeatureGrid {
 public:
  FeatureGrid() = default;
  /// In: levels and rows at most of each (a power of two); values are 0 plus at most +-`amplitude`,
  /// keyed by the seed.
  FeatureGrid(size_t channels, std::span<const int> levels, std::span<const uint32_t> most_rows,
              float amplitude, uint64_t seed);
  /// From stored levels. Errors: kFormat for sizes that do not fit together.
  FeatureGrid(size_t channels, std::vector<FeatureLevel> levels);

  size_t channels() const { return channels_; }
  std::vector<FeatureLevel>& levels() { return levels_; }
  const std::vector<FeatureLevel>& levels() const { return levels_; }
  uint64_t bytes() const;

  /// Out: [N] rows of `stride` floats: the levels behind each other, levels * channels numbers.
  void concatenate(const FeaturePlaces& places, float* out, size_t stride) const;
  /// Out: [N] rows of `stride` floats, to whose first numbers the sum over levels is added.
  void addSum(const FeaturePlaces& places, float* out, size_t stride) const;

  /// Derivatives of both by the features, added to `gradients` (one per level; empty at first).
  /// Threads and determinism: a level is one thread's; same bits for any number of threads.
  void backwardConcatenated(const FeaturePlaces& places, const float* gradient, size_t stride,
                            std::vector<FeatureGradient>& gradients) const;
  void backwardSum(const FeaturePlaces& places, const float* gradient, size_t stride,
                   std::vector<FeatureGradient>& gradients) const;
  /// Derivatives of the sum by the positions, added to position_gradient [N,3].
  void addPositionGradient(const FeaturePlaces& places, const float* gradient, size_t stride,
                           std::span<float> position_gradient) const;

 private:
  void backward(const FeaturePlaces& places, const float* gradient, size_t stride,
                size_t level_step, std::vector<FeatureGradient>& gradients) const;

  size_t channels_ = 0;
  std::vector<FeatureLevel> levels_;
};

}  // namespace stipple
