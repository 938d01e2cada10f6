#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/progress.h"
#include "splat/scene.h"

namespace stipple {

/// What the tiles need of one splat. The geometry stays double: a tile takes the difference to its
/// corner in double and goes on in float, so a wide picture or a long needle loses no digits.
struct VisibleSplat {
  Footprint<double> footprint;
  double half_x;  ///< pixels, as in Projected
  double half_y;
  float log2_opacity;
  float depth;      ///< view z, metres
  float colour[3];  ///< blending space
};

/// The splats that can show, in the order of blending.
struct VisibleSplats {
  std::unique_ptr<VisibleSplat[]>
      slots;                    ///< one per splat of the scene; only those in order are set
  std::vector<uint32_t> order;  ///< slots, front to back (depthKey, ties by splat index)
};

/// Projects, culls and sorts. Same result for any number of threads. Cost: O(splats).
VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress);

/// Bytes that findVisibleSplats allocates at most.
uint64_t visibleSplatsMemoryBound(uint64_t splat_count);

}  // namespace stipple
