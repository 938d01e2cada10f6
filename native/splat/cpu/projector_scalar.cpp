#include <algorithm>
#include <cmath>

#include "splat/cpu/projector.h"

namespace stipple {

size_t projectScalar(const PlacedScene& scene, const PlacedCloud& placed, size_t begin, size_t end,
                     const ProjectedSlots& to, size_t slot) {
  const TileGrid grid = gridOf(scene);
  for (size_t row = begin; row < end; ++row) {
    Projected<double> projected;
    if (!projectSplat(scene, placed, row, projected)) continue;
    VisibleSplat& splat = to.splats[slot];
    splat.footprint = projected.footprint;
    splat.half_x = projected.half_x;
    splat.half_y = projected.half_y;
    splat.log2_opacity = static_cast<float>(std::log2(projected.footprint.opacity));
    splat.depth = static_cast<float>(std::min(projected.depth, 1e38));
    splatColour(scene, placed, row, splat.colour);
    splat.index = static_cast<uint32_t>(placed.first_index + row);
    to.items[slot] = depthItem(projected.depth, slot);
    to.spans[slot] = tileSpanOf(splat, grid);
    ++slot;
  }
  return slot;
}

}  // namespace stipple
