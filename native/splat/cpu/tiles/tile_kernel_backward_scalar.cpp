#include <algorithm>
#include <cmath>

#include "splat/cpu/tiles/tile_kernel_backward.h"

namespace stipple {

namespace {

struct Offset {
  float g0, g1;
  float exponent;
};

Offset offsetAt(const TileSplat& splat, uint32_t x, uint32_t y) {
  const float column = static_cast<float>(x);
  Offset at;
  at.g0 = splat.g0 + splat.l00 * column;
  at.g1 = splat.g1 + splat.l10 * column + splat.l11 * static_cast<float>(y);
  at.exponent = splat.log2_opacity - (at.g0 * at.g0 + at.g1 * at.g1);
  return at;
}

PixelLoss<float> lossAt(const BackwardPixels& pixels, size_t i) {
  PixelLoss<float> loss;
  for (size_t c = 0; c < 4; ++c) loss.gradient[c] = pixels.gradient[c][i];
  loss.depth = pixels.depth[i];
  loss.depth_gradient = pixels.depth_gradient[i];
  for (size_t c = 0; c < 3; ++c) {
    loss.signed_weight[c] = pixels.signed_weight[c][i];
    loss.room[c] = pixels.room[c][i];
  }
  loss.edge = pixels.edge[i];
  loss.error = pixels.error[i];
  return loss;
}

void takeOffPixel(const TileSplat& splat, const Offset& at, BackwardWants wants,
                  BackwardPixels& pixels, size_t i, float* sums) {
  constexpr float kMost = static_cast<float>(kMaxAlpha);
  const float alpha = std::exp2(at.exponent);
  SplatAtPixel<float> here;
  here.alpha = std::min(kMost, alpha);
  here.held = !(alpha < kMost);
  here.g0 = at.g0;
  here.g1 = at.g1;
  here.l00 = splat.l00;
  here.l10 = splat.l10;
  here.l11 = splat.l11;
  std::copy(splat.colour, splat.colour + 3, here.colour);
  here.depth = splat.depth;
  PixelBackward<float> pixel;
  pixel.transmittance = pixels.transmittance[i];
  pixel.behind = pixels.behind[i];
  for (size_t c = 0; c < 3; ++c) pixel.signed_behind[c] = pixels.signed_behind[c][i];
  takeOff(here, lossAt(pixels, i), wants, pixel, sums);
  pixels.transmittance[i] = pixel.transmittance;
  pixels.behind[i] = pixel.behind;
  for (size_t c = 0; c < 3; ++c) pixels.signed_behind[c][i] = pixel.signed_behind[c];
}

}  // namespace

void takeOffTileScalar(const TileSplat* splats, size_t count, const TakeOffOptions& options,
                       BackwardPixels& pixels, float* sums) {
  const size_t field_count = backwardFieldCount(options.wants);
  std::fill(sums, sums + count * field_count, 0.0f);
  for (size_t s = count; s-- > 0;) {
    const TileSplat& splat = splats[s];
    const int32_t place = options.first + static_cast<int32_t>(s);
    for (uint32_t y = splat.row_begin; y < splat.row_end; ++y) {
      if (place >= pixels.row_end[y]) continue;
      for (uint32_t x = 0; x < kTileSide; ++x) {
        const size_t i = static_cast<size_t>(y) * kTileSide + x;
        if (place >= pixels.end[i]) continue;
        const Offset at = offsetAt(splat, x, y);
        if (at.exponent <= kLog2MinAlpha - splat.doubt_low) continue;
        float* own = sums + s * field_count;
        if (at.exponent >= kLog2MinAlpha + splat.doubt_high) {
          takeOffPixel(splat, at, options.wants, pixels, i, own);
        } else {
          options.judge(options.judge_context, s, static_cast<uint32_t>(i), pixels, own);
        }
      }
    }
  }
}

}  // namespace stipple
