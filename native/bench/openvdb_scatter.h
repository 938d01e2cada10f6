#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace stipple::bench {

/// The peer of anchor sampling: OpenVDB's tools::NonUniformPointScatter with std::mt19937_64, one
/// thread, on a grid whose voxels are the leaves. Its count is exact in the mean only.
class OpenvdbScatter {
 public:
  /// In: leaves [N] Morton codes; probabilities [N] of the leaves, sum 1.
  OpenvdbScatter(const std::vector<uint64_t>& leaves, const std::vector<double>& probabilities);
  ~OpenvdbScatter();
  /// Scatters about `count` points into a list of floats that it keeps; returns how many.
  size_t scatter(uint64_t count);

 private:
  struct Grid;
  std::unique_ptr<Grid> grid_;
};

}  // namespace stipple::bench
