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
    const Footprint<double>& f = projected.footprint;
    splat.mean_x = f.mean_x;
    splat.mean_y = f.mean_y;
    splat.l00 = f.l00;
    splat.l10 = f.l10;
    splat.l11 = f.l11;
    splat.half_y = heldHalf(projected.half_y);
    splat.log2_opacity = static_cast<float>(std::log2(f.opacity));
    splat.depth = static_cast<float>(std::min(projected.depth, 1e38));
    splatColour(scene, placed, row, splat.colour);
    to.extras[slot] = {f.opacity, projected.half_x,
                       static_cast<uint32_t>(placed.first_index + row)};
    to.items[slot] = depthItem(projected.depth, slot);
    to.spans[slot] = tileSpanOf(projected, grid);
    ++slot;
  }
  return slot;
}

}  // namespace stipple
