#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/adam_uniform.h"
#include "mesh/adapt/complexity.h"
#include "mesh/adapt/diffusion.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

enum class MeshDensity : uint32_t {
  kOff = 0,       ///< what fits the target alone
  kUniform = 1,   ///< even edges, in the first two fifths of the steps
  kAdaptive = 2,  ///< even edges in the first fifth, then shorter ones where the shape is complex
};

/// Lengths and weights are those of a mesh in the unit ball.
struct MeshAdapterOptions {
  MeshDensity density = MeshDensity::kAdaptive;
  double strength = 1.5;         ///< >= 0, weight of the density energy
  double adaptive_factor = 3.0;  ///< >= 0, by which the adaptive energy weighs more than that
  double shortest = 0.5;  ///< 0..1, of the mean length: nothing is told to become shorter than that
  double smoothness = 10.0;  ///< >= 0, lambda of M = I + lambda L; larger: broader steps, and
                             ///< detail that comes later
  double step_size = 0.05;   ///< > 0
  double last_share = 0.1;   ///< 0..1, of the step size that is left at the end: it falls evenly
                             ///< over the last tenth of the steps, so that they come to rest
  double laplacian = 0.0;    ///< >= 0, weight of the mean of |L x|^2 in all steps: a penalty that
                             ///< smooths, for comparison, since it resists density
  uint32_t steps = 800;      ///< >= 1
};

/// Errors: kInvalidArgument with the option, its value and what is allowed.
void validate(const MeshAdapterOptions& options);

/// Which energy a step adds to what its caller fits, and its weight.
struct DensityPhase {
  MeshDensity goal = MeshDensity::kOff;
  double weight = 0;
};

/// Steps 0 to N/5 even the edges out, from there to 2N/5 they adapt, and then the density is left
/// alone, so that the energy has no part in where the surface ends.
DensityPhase densityPhase(const MeshAdapterOptions& options, uint32_t step);

/// The share of the step size that a step takes: all of it to 9/10 of N, then less and less.
double stepShare(const MeshAdapterOptions& options, uint32_t step);

/// Moves the vertices of a mesh step by step: the caller's gradient and the forces of density, both
/// spread by M^-1, since not the positions x are optimised but u = M x. Faces are never changed.
/// Threads and determinism: the same positions for any number of threads.
/// Memory: two factors (Diffusion), about 300 bytes a vertex besides.
class MeshAdapter {
 public:
  /// In: positions [n], in the unit ball; n of links, which must outlive this.
  MeshAdapter(const MeshLinks& links, std::span<const Vec3d> positions,
              const MeshAdapterOptions& options);

  std::span<const Vec3d> positions() const { return positions_; }
  uint32_t stepCount() const { return step_; }
  /// In: gradient [n] of the caller's loss at positions(); it is overwritten.
  /// Returns the energy of density at those positions, times its weight. Cost: two solves of three
  /// columns, three of one where density adapts.
  double step(std::span<Vec3d> gradient);

 private:
  double addDensity(const DensityPhase& phase, std::span<Vec3d> gradient);
  void addLaplacian(std::span<Vec3d> gradient) const;

  const MeshLinks& links_;
  MeshAdapterOptions options_;
  Diffusion diffusion_;
  Complexity complexity_;
  AdamUniform optimiser_;
  std::vector<Vec3d> positions_, spread_;  ///< x, and u = M x
  uint32_t step_ = 0;
};

/// Bytes at most of a MeshAdapter and its links.
uint64_t meshAdapterMemoryBound(uint64_t vertex_count, uint64_t triangle_count);

}  // namespace stipple
