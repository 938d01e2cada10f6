#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "splat/cpu/depth_sort.h"
#include "splat/cpu/tiles/tile_grid.h"
#include "splat/render/scene.h"

namespace stipple {

/// What every tile needs of a splat: one cache line, since a tile's splats lie far apart. The
/// geometry stays double: a tile takes the difference to its corner in double and goes on in float,
/// so a wide picture or a long needle loses no digits.
struct VisibleSplat {
  double mean_x, mean_y;  ///< as in Footprint
  double l00, l10, l11;
  float half_y;  ///< pixels, as in Projected; infinite where that is above float32
  float log2_opacity;
  float depth;      ///< view z, metres
  float colour[3];  ///< blending space
};
static_assert(sizeof(VisibleSplat) == 64);

/// What is seldom needed of it.
struct VisibleExtra {
  double opacity;  ///< as in Footprint
  double half_x;   ///< pixels, as in Projected
  uint32_t index;  ///< among all splats of the picture: PlacedCloud::first_index + its row
};

/// Both, by slot: the place where a splat was put when it was projected.
struct SplatSlots {
  const VisibleSplat* splats = nullptr;
  const VisibleExtra* extras = nullptr;

  Footprint<double> footprint(uint32_t slot) const {
    const VisibleSplat& s = splats[slot];
    return {s.mean_x, s.mean_y, s.l00, s.l10, s.l11, extras[slot].opacity};
  }
};

/// Halves of boxes have a margin that is larger than this rounding.
inline float heldHalf(double half) {
  return half < 3e38 ? static_cast<float>(half) : std::numeric_limits<float>::infinity();
}

/// Where a projector puts what shows, by slot.
struct ProjectedSlots {
  VisibleSplat* splats;
  VisibleExtra* extras;
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
