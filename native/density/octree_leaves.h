#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "density/octree_density.h"

namespace stipple {

/// The leaves that hold mass, in Morton order.
struct OctreeLeaves {
  std::vector<uint64_t> codes;  ///< at the leaf level
  std::vector<double> masses;   ///< summed weights, > 0
};

/// Bounding cube of the points; refuses bad points and weights (see OctreeDensity::fromPoints).
RootCube boundingCube(std::span<const float> positions, std::span<const float> weights);

/// Sorts the points into the leaves of `root`. Sums run in the order of the points.
OctreeLeaves gatherLeaves(std::span<const float> positions, std::span<const float> weights,
                          const RootCube& root, int leaf_level);

}  // namespace stipple
