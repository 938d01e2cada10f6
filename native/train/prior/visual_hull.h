#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/views/view_source.h"
#include "density/octree_density.h"

namespace stipple {

struct VisualHullOptions {
  int level = 7;               ///< 2^level cells a side of the cube around the hull, 3..8
  size_t view_count = 100;     ///< at most, that are loaded
  size_t point_count = 60000;  ///< about
  uint64_t seed = 0;
};

/// Places where the silhouettes of views let something be.
struct VisualHull {
  std::vector<float> positions;  ///< [N,3] metres
  std::vector<float> weights;    ///< [N] > 0, mean 1
};

/// Cells of `where` that no silhouette excludes, found twice: in the whole cube, coarsely, and in
/// the cube around what was left. Most points stand in cells at its surface, some inside, as
/// hollows do not show in silhouettes. Nothing where pictures have no alpha or exclude next to
/// nothing. In: training: views of the source, at least one. Errors: those of ViewSource::load;
/// kCancelled. Threads and determinism: parallel; same result for any number of threads. Cost:
/// O(cells * views). Source: Laurentini, The Visual Hull Concept for Silhouette-Based Image
/// Understanding, IEEE PAMI 1994; Potmesil, Generating Octree Models of 3D Objects from their
/// Silhouettes, CVGIP 1987.
VisualHull visualHull(const ViewSource& views, std::span<const size_t> training,
                      const RootCube& where, const VisualHullOptions& options,
                      Progress* progress = nullptr);

}  // namespace stipple
