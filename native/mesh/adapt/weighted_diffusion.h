#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// The Laplacian of a mesh whose edges have weights: (L_w x)_i = sum over the neighbours j of i of
/// w_ij (x_i - x_j), w_ij = (weight_i + weight_j) / 2. In: weights [n]; values [n]. Out: [n].
/// Threads and determinism: parallel; same result for any number of threads.
void weightedLaplacian(const MeshLinks& links, std::span<const double> weights,
                       std::span<const Vec3d> values, std::span<Vec3d> out);

/// Implicit steps of a diffusion by weightedLaplacian(): (I / seconds + L_w) d = pull. Some
/// vertices move, the others stand still. Memory: that of the factor, about 8 n log2(n) numbers
/// with their indices.
class WeightedDiffusion {
 public:
  /// In: moves [n], 1 for vertices that move; links must outlive this.
  WeightedDiffusion(const MeshLinks& links, std::span<const uint8_t> moves);
  ~WeightedDiffusion();

  /// In: weights [n], >= 0; seconds > 0. Errors: kInternal where the factorisation fails. Cost:
  /// about n^1.5.
  void factor(std::span<const double> weights, double seconds);
  /// After factor(). In: pull [n]; out: d [n], 0 for vertices that stand still. Same result for any
  /// number of threads. Cost: O(size of the factor).
  void solve(std::span<Vec3d> values) const;

 private:
  struct Factor;
  const MeshLinks& links_;
  std::vector<uint32_t> row_of_;  ///< [n] among those that move
  std::vector<uint32_t> movers_;  ///< vertices of the rows
  std::unique_ptr<Factor> factor_;
};

}  // namespace stipple
