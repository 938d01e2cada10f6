#include <cmath>

#include "splat/cpu/rays/ray_tile_kernel.h"

namespace stipple {

size_t meetTileScalar(const RayTileSplat& s, float near_plane, float far_plane, const float* open,
                      RayMetPixels& met) {
  size_t count = 0;
  for (uint32_t row = s.row_begin; row < s.row_end; ++row) {
    const float y = static_cast<float>(row);
    for (uint32_t column = 0; column < kTileSide; ++column) {
      const uint32_t i = row * kTileSide + column;
      if (open[i] == 0.0f) continue;
      const float x = static_cast<float>(column);
      const float g0 = s.l00 * x + s.g0, g1 = s.l10 * x + s.g1 + s.l11 * y;
      const float w0 = s.w00 * x + s.w0 + s.w01 * y, w1 = s.w11 * y + s.w1;
      const float inverse = 1.0f / (w0 * w0 + w1 * w1 + s.rest);
      const float exponent = s.log2_opacity - (g0 * g0 + g1 * g1) * inverse;
      const float place = (s.nx * x + s.n + s.ny * y) * inverse;
      if (!(exponent > s.log2_least && place >= near_plane && place <= far_plane)) continue;
      met.exponent[count] = exponent;
      met.alpha[count] = std::exp2(exponent);
      met.place[count] = place;
      met.pixel[count++] = i;
    }
  }
  return count;
}

}  // namespace stipple
