#pragma once

#include <span>
#include <vector>

#include "math/vec.h"
#include "mesh/adapt/density_energy.h"
#include "mesh/adapt/diffusion.h"
#include "mesh/adapt/mesh_links.h"

namespace stipple {

/// Says how complex the shape is around each vertex, and how long edges there should become.
class Complexity {
 public:
  explicit Complexity(const MeshLinks& links);

  /// c_i = |L x|_i / mean length, 0 at vertices of the border, smoothed three times by
  /// (0.5 I + 0.5 L)^-1 and divided by its mean. All 1 where the shape has no complexity anywhere.
  std::vector<double> values(std::span<const Vec3d> positions, const VertexLengths& lengths) const;

  /// goal_i = m_i * min(1, 1 / c_i): present lengths, shorter where the shape is more complex than
  /// on average, but not below `shortest` times the mean length: since the goal follows the present
  /// length, a complex place would else collapse. Constants to densityEnergy(). Threads and
  /// determinism: parallel; same result for any number of threads. Cost: three solves of one
  /// column.
  std::vector<double> goals(std::span<const Vec3d> positions, const VertexLengths& lengths,
                            double shortest = 0) const;

 private:
  const MeshLinks& links_;
  Diffusion smoothing_;
};

}  // namespace stipple
