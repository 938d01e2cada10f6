#include "splat/cpu/tiles/tile.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "splat/cpu/tiles/tile_splats.h"

namespace stipple {

namespace {

#include "splat/cpu/tiles/tile_splat_steps-inl.h"

/// Everything but finish_doubt and what gatherTileSplats copies. Returns the size of g and l.
float fillTileSplat(const double (&fields)[kTileSplatFields], const Tile& tile, TileSplat& out) {
  TileSplatSteps<double> made;
  tileSplatSteps(fields, tile.x0 + 0.5, tile.y0 + 0.5, static_cast<double>(tile.cut_off.reach),
                 made);
  out.g0 = static_cast<float>(made.g0);
  out.g1 = static_cast<float>(made.g1);
  out.l00 = static_cast<float>(made.l00);
  out.l10 = static_cast<float>(made.l10);
  out.l11 = static_cast<float>(made.l11);
  out.doubt_low = static_cast<float>(made.doubt_low);
  out.doubt_high = made.largest > static_cast<double>(kMaxFloatReach) ? kFinished : out.doubt_low;
  out.row_begin = kTileSide - static_cast<uint32_t>(made.below);
  out.row_end = static_cast<uint32_t>(made.above);
  return static_cast<float>(made.largest);
}

}  // namespace

float TileCutOff::medianDoubt(size_t count) const {
  if (most_splats == 2350) return kMedianDoubt;
  // ln 2 of ln 1e4: 177 splats of 1/255.
  const size_t most = std::min(count, most_splats / 13);
  return kMedianDoubt * reach + 1.2e-7f * static_cast<float>(most);
}

TileCutOff cutOffOf(double least_alpha) {
  TileCutOff cut_off;
  cut_off.least_alpha = least_alpha;
  if (least_alpha == kMinAlpha) return cut_off;
  cut_off.log2_least = static_cast<float>(std::log2(least_alpha));
  if (least_alpha > kMinAlpha) return cut_off;
  cut_off.reach = static_cast<float>(std::max(1.0, std::sqrt(-std::log2(least_alpha)) / 2.82));
  cut_off.most_splats =
      static_cast<size_t>(std::log(kMinTransmittance) / std::log1p(-least_alpha)) + 1;
  return cut_off;
}

Tile tileOf(const TileGrid& grid, size_t index, std::span<const uint32_t> splats) {
  Tile tile;
  tile.x0 = static_cast<uint32_t>(index % grid.columns) * kTileSide;
  tile.y0 = static_cast<uint32_t>(index / grid.columns) * kTileSide;
  tile.width = std::min(kTileSide, grid.width - tile.x0);
  tile.height = std::min(kTileSide, grid.height - tile.y0);
  tile.splats = splats;
  return tile;
}

TileSplat makeTileSplat(const VisibleSplat& splat, const Tile& tile) {
  TileSplat out;
  const float largest = fillTileSplat({splat.mean_x, splat.mean_y, splat.l00, splat.l10, splat.l11,
                                       static_cast<double>(splat.half_y)},
                                      tile, out);
  out.finish_doubt = std::min(largest, kMaxFloatReach);
  out.log2_opacity = splat.log2_opacity;
  out.depth = splat.depth;
  std::copy(splat.colour, splat.colour + 3, out.colour);
  return out;
}

float makeTileSplatsScalar(const VisibleSplat* visible, const Tile& tile, size_t begin,
                           size_t count, TileSplat* out) {
  TileSplatColumns columns;
  gatherTileSplats(visible, tile, begin, count, columns, out);
  float largest = 0;
  for (size_t i = 0; i < count; ++i) {
    double fields[kTileSplatFields];
    for (size_t k = 0; k < kTileSplatFields; ++k) fields[k] = columns[k][i];
    largest = std::max(largest, fillTileSplat(fields, tile, out[i]));
  }
  return largest;
}

void makeTileSplats(const VisibleSplat* visible, const Tile& tile, size_t begin, size_t count,
                    float& largest, TileSplat* out) {
  const TileSplatMaker maker = chosenTileSplatMaker();
  for (size_t first = 0; first < count; first += kTileSplatBatch) {
    const size_t here = std::min(kTileSplatBatch, count - first);
    const float seen = maker(visible, tile, begin + first, here, out + first);
    largest = std::max(largest, std::min(seen, kMaxFloatReach));
    const float doubt =
        finishDoubt(largest, begin + first + here, tile.cut_off.reach, tile.cut_off.most_splats);
    for (size_t i = 0; i < here; ++i) out[first + i].finish_doubt = doubt;
  }
}

double alphaInDouble(const SplatSlots& slots, uint32_t slot, const Tile& tile, uint32_t x,
                     uint32_t y) {
  double distance;
  if (!mayShow(slots.splats[slot], tile, x, y, distance)) return 0.0;
  return splatAlpha(slots.extras[slot].opacity, distance, tile.cut_off.least_alpha);
}

void clearPixels(const Tile& tile, TilePixels& pixels) {
  std::fill(std::begin(pixels.transmittance), std::end(pixels.transmittance), 1.0f);
  for (float* plane : {pixels.red, pixels.green, pixels.blue, pixels.weighted_depth,
                       pixels.coverage, pixels.count, pixels.doubt}) {
    std::fill(plane, plane + kTilePixelCount, 0.0f);
  }
  std::fill(std::begin(pixels.median_depth), std::end(pixels.median_depth), kNoMedian);
  for (uint32_t y = 0; y < kTileSide; ++y) {
    for (uint32_t x = 0; x < kTileSide; ++x) {
      const bool inside = x < tile.width && y < tile.height;
      pixels.cut[y * kTileSide + x] = inside ? kLog2MinAlpha : kFinished;
      pixels.end[y * kTileSide + x] = inside ? kNeverEnded : 0;
    }
  }
  pixels.unfinished = tile.width * tile.height;
}

}  // namespace stipple
