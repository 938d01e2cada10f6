#include <algorithm>
#include <cmath>

#include "splat/cpu/tile_kernel_backward.h"

namespace stipple {

namespace {

struct Offset {
  float g0, g1;
  float exponent;
};

Offset offsetAt(const BackwardSplat& splat, uint32_t x, uint32_t y) {
  const float column = static_cast<float>(x);
  Offset at;
  at.g0 = splat.g0 + splat.l00 * column;
  at.g1 = splat.g1 + splat.l10 * column + splat.l11 * static_cast<float>(y);
  at.exponent = splat.log2_opacity - (at.g0 * at.g0 + at.g1 * at.g1);
  return at;
}

void markPixel(BackwardSplat& splat, float exponent, int32_t place, uint32_t y,
               BackwardPixels& pixels, size_t i) {
  bool doubtful = exponent < kLog2MinAlpha + splat.doubt_high;
  bool ends = doubtful;
  if (!doubtful) {
    const float alpha = std::min(static_cast<float>(kMaxAlpha), std::exp2(exponent));
    const float next = pixels.transmittance[i] * (1.0f - alpha);
    constexpr float kLeast = static_cast<float>(kMinTransmittance);
    doubtful = std::abs(next - kLeast) < kLeast * kFinishDoubt;
    ends = doubtful || next < kLeast;
    if (!ends) {
      pixels.transmittance[i] = next;
      pixels.last[i] = place;
      splat.rows |= 1u << y;
    }
  }
  if (!ends) return;
  if (doubtful) pixels.doubt[i] = 1.0f;
  pixels.cut[i] = kFinished;
  --pixels.unfinished;
}

PixelLoss<float> lossAt(const BackwardPixels& pixels, size_t i) {
  PixelLoss<float> loss;
  for (size_t c = 0; c < 4; ++c) loss.gradient[c] = pixels.gradient[c][i];
  for (size_t c = 0; c < 3; ++c) {
    loss.signed_weight[c] = pixels.signed_weight[c][i];
    loss.room[c] = pixels.room[c][i];
  }
  loss.edge = pixels.edge[i];
  loss.error = pixels.error[i];
  return loss;
}

void takeOffPixel(const BackwardSplat& splat, const Offset& at, BackwardMode mode,
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
  PixelBackward<float> pixel;
  pixel.transmittance = pixels.transmittance[i];
  pixel.behind = pixels.behind[i];
  for (size_t c = 0; c < 3; ++c) pixel.colour_behind[c] = pixels.colour_behind[c][i];
  takeOff(here, lossAt(pixels, i), mode, pixel, sums);
  pixels.transmittance[i] = pixel.transmittance;
  pixels.behind[i] = pixel.behind;
  for (size_t c = 0; c < 3; ++c) pixels.colour_behind[c][i] = pixel.colour_behind[c];
}

}  // namespace

void markTileScalar(BackwardSplat* splats, size_t count, int32_t first, BackwardPixels& pixels) {
  for (size_t s = 0; s < count; ++s) {
    BackwardSplat& splat = splats[s];
    splat.rows = 0;
    if (pixels.unfinished == 0) continue;
    for (uint32_t y = splat.row_begin; y < splat.row_end; ++y) {
      for (uint32_t x = 0; x < kTileSide; ++x) {
        const size_t i = static_cast<size_t>(y) * kTileSide + x;
        if (pixels.cut[i] == kFinished) continue;
        const Offset at = offsetAt(splat, x, y);
        if (at.exponent <= kLog2MinAlpha - splat.doubt_low) continue;
        markPixel(splat, at.exponent, first + static_cast<int32_t>(s), y, pixels, i);
      }
    }
  }
}

void takeOffTileScalar(const BackwardSplat* splats, size_t count, int32_t first, BackwardMode mode,
                       BackwardPixels& pixels, float* sums) {
  const size_t field_count = backwardFieldCount(mode);
  std::fill(sums, sums + count * field_count, 0.0f);
  for (size_t s = count; s-- > 0;) {
    const BackwardSplat& splat = splats[s];
    const int32_t place = first + static_cast<int32_t>(s);
    for (uint32_t y = 0; y < kTileSide; ++y) {
      if (!(splat.rows >> y & 1u)) continue;
      for (uint32_t x = 0; x < kTileSide; ++x) {
        const size_t i = static_cast<size_t>(y) * kTileSide + x;
        if (place > pixels.last[i]) continue;
        const Offset at = offsetAt(splat, x, y);
        if (at.exponent <= kLog2MinAlpha - splat.doubt_low) continue;
        takeOffPixel(splat, at, mode, pixels, i, sums + s * field_count);
      }
    }
  }
}

}  // namespace stipple
