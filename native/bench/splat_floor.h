#pragma once

#include <cstdint>
#include <span>

#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/render/render.h"

namespace stipple::bench {

/// The blending loop alone, and the pair list that it ran on.
struct BlendFloor {
  /// Wall time of the loop if the threads share it evenly: over all 256 pixels of every listed pair
  /// of splat and tile, until all pixels of the tile have ended. Nothing is culled below the tile.
  double seconds = 1e300;
  /// The same without the rows of a tile that lie outside the splat's box.
  double row_skip_seconds = 1e300;
  /// The same of the renderer's own loop, which also leaves out the rows and columns of lanes in
  /// which a splat reaches no pixel that has not ended.
  double culled_seconds = 1e300;
  uint64_t listed_pairs = 0;   ///< splat-tile pairs of the renderer's lists
  uint64_t exact_pairs = 0;    ///< pairs whose ellipse meets the tile, in double
  uint64_t missing_pairs = 0;  ///< exact pairs that the lists lack; must be 0
};

/// Times `kernel`, all three ways, on the renderer's own tiles, whose splats are made ready outside
/// the clock; the rest of a picture (projection, sorting, lists, making splats ready, writing
/// pixels) is left out. Best of `repeats` runs on `threads` threads. Pairs are counted once.
BlendFloor measureBlendFloor(std::span<const SplatInstance> instances, const Camera& camera,
                             TileKernel kernel, unsigned threads, int repeats);

}  // namespace stipple::bench
