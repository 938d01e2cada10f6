#pragma once

#include <cstdint>
#include <span>

#include "splat/cpu/tile_kernel.h"
#include "splat/render.h"

namespace stipple::bench {

/// The blending loop alone, and the pair list that it ran on.
struct BlendFloor {
  double seconds = 0;          ///< wall time of the loop if the threads share it evenly
  uint64_t listed_pairs = 0;   ///< splat-tile pairs of the renderer's lists
  uint64_t exact_pairs = 0;    ///< pairs whose ellipse meets the tile, in double
  uint64_t missing_pairs = 0;  ///< exact pairs that the lists lack; must be 0
};

/// Times `kernel` on the renderer's own tiles, whose splats are made ready outside the clock; the
/// rest of a picture (projection, sorting, lists, making splats ready, writing pixels) is left out.
/// Best of `repeats` runs on `threads` threads. Pairs are counted once.
BlendFloor measureBlendFloor(std::span<const SplatInstance> instances, const Camera& camera,
                             TileKernel kernel, unsigned threads, int repeats);

}  // namespace stipple::bench
