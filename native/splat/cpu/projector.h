#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "splat/cpu/tile_grid.h"
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

/// Asks for the up to three cache lines of a splat.
inline void prefetchSplat(const VisibleSplat* splat) {
  const char* first = reinterpret_cast<const char*>(splat);
  __builtin_prefetch(first);
  __builtin_prefetch(first + 64);
  __builtin_prefetch(first + sizeof(VisibleSplat) - 1);
}

/// Sorts as unsigned numbers: depthKey above, the splat's place in memory below.
using DepthItem = uint64_t;

inline DepthItem depthItem(double depth, size_t slot) {
  return static_cast<uint64_t>(depthKey(depth)) << 32 | static_cast<uint32_t>(slot);
}

/// Where a projector puts what shows; the arrays have the same indices, called slots.
struct ProjectedSlots {
  VisibleSplat* splats;
  DepthItem* items;
  TileSpan* spans;
};

/// Projects rows [begin, end) of one cloud. The visible ones go to `slot`, slot + 1, ...; returns
/// the slot after the last.
using Projector = size_t (*)(const PlacedScene& scene, const PlacedCloud& placed, size_t begin,
                             size_t end, const ProjectedSlots& to, size_t slot);

struct NamedProjector {
  const char* target;  ///< as NamedTileKernel::target
  Projector project;
};

/// One splat after another; the vector targets give the same footprints, depths and colours, bit
/// for bit, and bounds that differ by rounding.
size_t projectScalar(const PlacedScene& scene, const PlacedCloud& placed, size_t begin, size_t end,
                     const ProjectedSlots& to, size_t slot);

/// The grid of the scene's picture.
inline TileGrid gridOf(const PlacedScene& scene) {
  return TileGrid(static_cast<uint32_t>(scene.view.width),
                  static_cast<uint32_t>(scene.view.height));
}

/// As chosenTileKernel() and tileKernels().
Projector chosenProjector();
std::vector<NamedProjector> projectors();

}  // namespace stipple
