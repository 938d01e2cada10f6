#pragma once

#include <memory>
#include <span>

#include "math/vec.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// The uniform Laplacian of a mesh: (L x)_i = sum over the neighbours j of i of (x_i - x_j). Out:
/// [n]. Threads and determinism: parallel; same result for any number of threads.
void laplacian(const MeshLinks& links, std::span<const Vec3d> values, std::span<Vec3d> out);

/// The matrix stay * I + spread * L, factored once: symmetric and positive definite.
/// Memory: that of the factor, about 8 n log2(n) numbers with their indices.
class Diffusion {
 public:
  /// In: stay > 0, spread >= 0. Errors: kInternal where the factorisation fails. Cost: about n^1.5.
  Diffusion(const MeshLinks& links, double stay, double spread);
  ~Diffusion();

  /// Solves in place, for three columns (on up to three threads) or one. Same result for any number
  /// of threads. Cost: O(size of the factor).
  void solve(std::span<Vec3d> values) const;
  void solve(std::span<double> values) const;
  /// values = matrix * values.
  void multiply(std::span<Vec3d> values) const;

 private:
  struct Factor;
  const MeshLinks& links_;
  double stay_, spread_;
  std::unique_ptr<const Factor> factor_;
};

}  // namespace stipple
