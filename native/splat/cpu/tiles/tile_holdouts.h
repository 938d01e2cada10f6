#pragma once

#include <cstdint>

#include "splat/cpu/tiles/tile_kernel.h"

namespace stipple {

/// What is blended in place of the splats' colours. A tile with holdouts is blended twice: once for
/// the picture, once for the shares of what shows and what only hides.
enum class Paint : uint32_t {
  kStored,   ///< the colours as they are: there are no holdouts
  kColours,  ///< holdouts black
  kShares,   ///< red 1 and green the depth where a splat shows, blue 1 where it only hides
  kNormals,  ///< normals, holdouts 0
  kObjects,  ///< 1 where a splat is of the wanted object, one for each of red, green and blue
};

struct Painter {
  Paint paint = Paint::kStored;
  const float* normals = nullptr;     ///< 3 by slot, of kNormals
  const uint32_t* objects = nullptr;  ///< by slot, of kObjects
  uint32_t wanted[3] = {0, 0, 0};

  /// In and out: colour [3], kHoldoutColour where the splat is a holdout.
  void apply(uint32_t slot, float depth, float* colour) const;
};

/// A batch of a tile. In: slots [count].
void paintSplats(const Painter& painter, const uint32_t* slots, size_t count, TileSplat* splats);

/// Sums of w of one pixel that was blended as Paint::kShares.
struct PixelShares {
  float shown;
  float shown_depth;  ///< of w z
  float hidden;
};

inline PixelShares sharesOf(const TilePixels& blended, size_t pixel) {
  return {blended.red[pixel], blended.green[pixel], blended.blue[pixel]};
}

}  // namespace stipple
