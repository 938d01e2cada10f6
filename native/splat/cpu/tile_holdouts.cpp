#include "splat/cpu/tile_holdouts.h"

namespace stipple {

void paintSplat(Paint paint, float depth, float* colour) {
  if (paint == Paint::kStored) return;
  const bool hides = colour[0] < 0.0f;
  if (paint == Paint::kShares) {
    colour[0] = hides ? 0.0f : 1.0f;
    colour[1] = hides ? 0.0f : depth;
    colour[2] = hides ? 1.0f : 0.0f;
  } else if (hides) {
    colour[0] = colour[1] = colour[2] = 0.0f;
  }
}

void paintSplats(Paint paint, size_t count, TileSplat* splats) {
  if (paint == Paint::kStored) return;
  for (size_t i = 0; i < count; ++i) paintSplat(paint, splats[i].depth, splats[i].colour);
}

}  // namespace stipple
