#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

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
  uint32_t index;   ///< among all splats of the picture: PlacedCloud::first_index + its row
};

/// The splats that can show, in the order of blending: front to back by depthKey, ties by splat
/// index. They lie in memory in that order too, since every later step walks them in it.
struct VisibleSplats {
  std::unique_ptr<VisibleSplat[]> splats;
  size_t count = 0;
};

/// Projects, culls and sorts. Same result for any number of threads. Cost: O(splats).
VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress);

/// Bytes that findVisibleSplats allocates at most.
uint64_t visibleSplatsMemoryBound(uint64_t splat_count);

}  // namespace stipple
