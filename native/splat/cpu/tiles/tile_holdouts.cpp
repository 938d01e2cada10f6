#include "splat/cpu/tiles/tile_holdouts.h"

#include <algorithm>

namespace stipple {

void Painter::apply(uint32_t slot, float depth, float* colour) const {
  if (paint == Paint::kStored) return;
  const bool hides = colour[0] < 0.0f;
  if (paint == Paint::kShares) {
    colour[0] = hides ? 0.0f : 1.0f;
    colour[1] = hides ? 0.0f : depth;
    colour[2] = hides ? 1.0f : 0.0f;
  } else if (hides) {
    colour[0] = colour[1] = colour[2] = 0.0f;
  } else if (paint == Paint::kNormals) {
    std::copy_n(normals + size_t{slot} * 3, 3, colour);
  } else if (paint == Paint::kObjects) {
    for (size_t c = 0; c < 3; ++c) colour[c] = objects[slot] == wanted[c] ? 1.0f : 0.0f;
  }
}

void paintSplats(const Painter& painter, const uint32_t* slots, size_t count, TileSplat* splats) {
  if (painter.paint == Paint::kStored) return;
  for (size_t i = 0; i < count; ++i) painter.apply(slots[i], splats[i].depth, splats[i].colour);
}

}  // namespace stipple
