#include <algorithm>
#include <cmath>

#include "splat/cpu/tiles/tile_kernel.h"
#include "splat/render/blend.h"
#include "splat/render/effects.h"

namespace stipple {

namespace {

bool near(float value, float threshold, float relative) {
  return std::abs(value - threshold) < threshold * relative;
}

void finish(TilePixels& pixels, size_t i, int32_t place) {
  pixels.cut[i] = kFinished;
  pixels.end[i] = place;
  --pixels.unfinished;
}

void finishInDoubt(TilePixels& pixels, size_t i, int32_t place) {
  pixels.doubt[i] = 1.0f;
  finish(pixels, i, place);
}

void blendPixel(const TileSplat& splat, float alpha, const TileKernelOptions& options,
                TilePixels& pixels, size_t i, int32_t place) {
  PixelBlend<float> pixel;
  pixel.transmittance = pixels.transmittance[i];
  pixel.has_median = pixels.median_depth[i] != kNoMedian;
  const float next = pixel.transmittance * (1.0f - alpha);
  if (near(next, static_cast<float>(kMinTransmittance), splat.finish_doubt) ||
      (options.with_extras && near(next, 0.5f, options.median_doubt))) {
    finishInDoubt(pixels, i, place);
    return;
  }
  const bool had_median = pixel.has_median;
  const float weight = pixel.transmittance * alpha;
  pixel.add(alpha, splat.colour, splat.depth);
  if (pixel.finished) {
    finish(pixels, i, place);
    return;
  }
  pixels.transmittance[i] = pixel.transmittance;
  pixels.red[i] += pixel.colour[0];
  pixels.green[i] += pixel.colour[1];
  pixels.blue[i] += pixel.colour[2];
  if (kHasEffects && options.with_depth) pixels.weighted_depth[i] += pixel.weighted_depth;
  if (kHasEffects && options.with_depth && options.with_coverage) pixels.coverage[i] += weight;
  if (kHasEffects && options.with_extras) {
    if (pixel.has_median && !had_median) pixels.median_depth[i] = splat.depth;
    pixels.count[i] += 1.0f;
  }
}

/// The surface of a pixel that a splat behind it touches. Returns false where the pixel ends.
bool passSurface(const TileSplat& splat, const TileKernelOptions& options, TilePixels& pixels,
                 size_t i, int32_t place) {
  PixelBlend<float> pixel;
  pixel.transmittance = pixels.transmittance[i];
  pixel.has_median = pixels.median_depth[i] != kNoMedian;
  const bool had_median = pixel.has_median;
  pixel.addSurface({pixels.wall[i], pixels.passes[i], options.surface_shows});
  pixels.before[i] = pixel.surface_weight;
  pixels.transmittance[i] = pixel.transmittance;
  if (options.with_extras && pixel.has_median && !had_median) {
    pixels.median_depth[i] = pixels.wall[i];
  }
  pixels.wall[i] = kNoSurface;
  const float next = pixel.transmittance;
  if (near(next, static_cast<float>(kMinTransmittance), splat.finish_doubt) ||
      (options.with_extras && near(next, 0.5f, options.median_doubt))) {
    finishInDoubt(pixels, i, place);
    return false;
  }
  if (pixel.finished) finish(pixels, i, place);
  return !pixel.finished;
}

}  // namespace

void blendTileScalar(const TileSplat* splats, size_t count, TileKernelOptions options,
                     TilePixels& pixels) {
  for (size_t s = 0; s < count && pixels.unfinished > 0; ++s) {
    const TileSplat& splat = splats[s];
    const int32_t place = options.first + static_cast<int32_t>(s);
    for (uint32_t y = splat.row_begin; y < splat.row_end; ++y) {
      for (uint32_t x = 0; x < kTileSide; ++x) {
        const size_t i = static_cast<size_t>(y) * kTileSide + x;
        if (pixels.cut[i] == kFinished) continue;
        const float column = static_cast<float>(x);
        const float g0 = splat.g0 + splat.l00 * column;
        const float g1 = splat.g1 + splat.l10 * column + splat.l11 * static_cast<float>(y);
        const float exponent = splat.log2_opacity - (g0 * g0 + g1 * g1);
        if (exponent <= options.log2_least - splat.doubt_low) continue;
        if (kHasEffects && options.with_surface && splat.depth > pixels.wall[i] &&
            !passSurface(splat, options, pixels, i, place)) {
          continue;
        }
        if (exponent >= options.log2_least + splat.doubt_high) {
          const float alpha = std::min(static_cast<float>(kMaxAlpha), std::exp2(exponent));
          blendPixel(splat, alpha, options, pixels, i, place);
        } else if (options.judge) {
          const double alpha = options.judge(options.judge_context, s, static_cast<uint32_t>(i));
          if (alpha > 0) blendPixel(splat, static_cast<float>(alpha), options, pixels, i, place);
        } else {
          finishInDoubt(pixels, i, place);
        }
      }
    }
  }
}

}  // namespace stipple
