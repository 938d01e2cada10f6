#include "splat/cpu/tiles/tile_surface.h"

#include <algorithm>
#include <cmath>

#include "splat/render/surface.h"

namespace stipple {

void takeSurface(const SurfaceLayer& surface, const VisibleSplat* visible, Tile& tile,
                 TilePixels& pixels) {
  float furthest = -kNoSurface;
  std::fill(pixels.wall, pixels.wall + kTilePixelCount, kNoSurface);
  std::fill(pixels.passes, pixels.passes + kTilePixelCount, 1.0f);
  std::fill(pixels.before, pixels.before + kTilePixelCount, kNotYet);
  forEachPixel(tile, surface.width, [&](size_t i, size_t at) {
    const SurfaceAtPixel<float> here = surfaceAt<float>(surface, at);
    pixels.wall[i] = here.depth;
    pixels.passes[i] = here.transmittance;
    furthest = std::max(furthest, here.transmittance > 0.0f ? kNoSurface : here.depth);
  });
  const auto behind =
      std::partition_point(tile.splats.begin(), tile.splats.end(),
                           [&](uint32_t slot) { return !(visible[slot].depth > furthest); });
  tile.splats = tile.splats.first(static_cast<size_t>(behind - tile.splats.begin()));
}

void endWithSurface(const SurfaceLayer& surface, const Tile& tile, bool with_extras,
                    TilePixels& pixels) {
  const bool shows = surface.colour != nullptr;
  const float median_doubt = tile.cut_off.medianDoubt(tile.splats.size());
  forEachPixel(tile, surface.width, [&](size_t i, size_t) {
    if (pixels.before[i] >= 0.0f) return;
    PixelBlend<float> pixel;
    pixel.transmittance = pixels.transmittance[i];
    pixel.has_median = pixels.median_depth[i] != kNoMedian;
    const bool had_median = pixel.has_median;
    pixel.addSurface({pixels.wall[i], pixels.passes[i], shows});
    pixels.before[i] = pixel.surface_weight;
    pixels.transmittance[i] = pixel.transmittance;
    if (!with_extras || !shows) return;
    if (std::abs(pixel.transmittance - 0.5f) < 0.5f * median_doubt) pixels.doubt[i] = 1.0f;
    if (pixel.has_median && !had_median) pixels.median_depth[i] = pixel.median_depth;
  });
}

void writeWithSurface(const Tile& tile, const TilePixels& pixels, const TilePixels* shares,
                      const RenderOptions& options, RenderResult& result) {
  const float background[3] = {static_cast<float>(options.background[0]),
                               static_cast<float>(options.background[1]),
                               static_cast<float>(options.background[2])};
  forEachPixel(tile, result.width, [&](size_t i, size_t at) {
    const SurfaceAtPixel<float> surface = surfaceAt<float>(options.surface, at);
    PixelBlend<float> pixel;
    pixel.transmittance = pixels.transmittance[i];
    pixel.surface_weight = pixels.before[i];
    float coverage = pixel.splatCoverage(surface);
    float weighted_depth = pixels.weighted_depth[i];
    float hidden = 0.0f;
    if (shares && sharesOf(*shares, i).hidden > 0.0f) {
      const PixelShares share = sharesOf(*shares, i);
      coverage = share.shown;
      weighted_depth = share.shown_depth;
      if (options.with_background) hidden = share.hidden;
    }
    const float behind = options.with_background ? pixel.transmittance : 0.0f;
    float* colour = &result.colour[at * 4];
    colour[0] = pixels.red[i] + behind * background[0];
    colour[1] = pixels.green[i] + behind * background[1];
    colour[2] = pixels.blue[i] + behind * background[2];
    colour[3] =
        alphaApart(surface, pixel.surface_weight, coverage, options.with_background) - hidden;
    if (options.with_depth) {
      result.depth[at] =
          depthWithSurface(weighted_depth, coverage, surface, pixel.surface_weight, kEmptyDepth);
    }
    if (options.splats_apart) {
      result.surface_weight[at] = pixel.surface_weight;
    } else if (surface.shows) {
      addSurface(options.surface.colour + at * 4, &pixel.surface_weight, 1, colour);
    }
  });
}

}  // namespace stipple
