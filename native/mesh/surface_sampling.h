#pragma once

#include <cstdint>

#include "base/progress.h"
#include "data/meshes/point_set.h"
#include "data/meshes/tri_mesh.h"

namespace stipple {

struct SurfaceSamplingOptions {
  uint64_t count = 500000;     ///< samples; more of them follow detail closer, cost memory and time
  uint64_t detail_count = 0;   ///< further samples at most, which lie where there is detail
  double detail_weight = 1.0;  ///< >= 0; 0: anchors are uniform over the area; 1: places with
                               ///< texture detail or curvature attract several times more
  uint64_t seed = 0;
  /// 0..kMaxViewDegree: of the harmonics of samples whose material looks different from different
  /// sides. 0: they have the colour along their normal.
  int harmonic_degree = kMaxViewDegree;
};

/// Area-weighted, stratified samples of every triangle of a mesh, with normals (interpolated),
/// colours (scene linear) and weights for the density (area times detail). With a detail_count,
/// samples are split where there is detail, into four at most. Errors: kInvalidArgument
/// for a mesh without area or a mesh that validate() refuses. Same result for any number of
/// threads.
PointSet sampleSurface(const TriMesh& mesh, const SurfaceSamplingOptions& options,
                       Progress* progress = nullptr);

}  // namespace stipple
