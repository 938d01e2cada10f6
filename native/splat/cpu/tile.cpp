#include "splat/cpu/tile.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace stipple {

namespace {

constexpr size_t kPrefetchDistance = 24;

[[gnu::always_inline]] inline void fillTileSplat(const VisibleSplat& splat, const Tile& tile,
                                                 TileSplat& out) {
  constexpr double kScale = 0.84932180028801904;  // sqrt(log2(e)/2)
  constexpr double kSide = kTileSide;
  const Footprint<double>& f = splat.footprint;
  const double dx = tile.x0 + 0.5 - f.mean_x;
  const double dy = tile.y0 + 0.5 - f.mean_y;
  const double g0 = kScale * (f.l00 * dx);
  const double g1 = kScale * (f.l10 * dx + f.l11 * dy);
  const double l00 = kScale * f.l00;
  const double l10 = kScale * f.l10;
  const double l11 = kScale * f.l11;
  out.g0 = static_cast<float>(g0);
  out.g1 = static_cast<float>(g1);
  out.l00 = static_cast<float>(l00);
  out.l10 = static_cast<float>(l10);
  out.l11 = static_cast<float>(l11);
  out.log2_opacity = splat.log2_opacity;
  // |g| <= 2.83 where alpha >= 1/255, and g is off by at most 4 roundings of its largest term.
  const double largest =
      std::abs(g0) + std::abs(g1) + (kSide - 1) * (std::abs(l00) + std::abs(l10) + std::abs(l11));
  out.doubt_low = static_cast<float>(2e-6 * largest + 4e-6);
  out.doubt_high = largest > static_cast<double>(kMaxFloatReach) ? kFinished : out.doubt_low;
  out.finish_doubt = static_cast<float>(std::min(largest, static_cast<double>(kMaxFloatReach)));
  std::copy(splat.colour, splat.colour + 3, out.colour);
  out.depth = splat.depth;
  // Whole parts by conversion, which is one instruction everywhere, unlike std::floor.
  const double first = std::clamp(-dy - splat.half_y, 0.0, kSide);
  out.row_begin = static_cast<uint32_t>(first);
  out.row_begin += static_cast<double>(out.row_begin) < first ? 1 : 0;
  out.row_end = static_cast<uint32_t>(std::clamp(-dy + splat.half_y + 1.0, 0.0, kSide));
}

}  // namespace

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
  fillTileSplat(splat, tile, out);
  return out;
}

void makeTileSplats(const VisibleSplat* visible, const Tile& tile, size_t begin, size_t count,
                    float& largest, TileSplat* out) {
  for (size_t i = 0; i < count; ++i) {
    // A tile's splats lie far apart, so each would wait for memory.
    const size_t ahead = std::min(begin + i + kPrefetchDistance, tile.splats.size() - 1);
    prefetchSplat(&visible[tile.splats[ahead]]);
    fillTileSplat(visible[tile.splats[begin + i]], tile, out[i]);
    largest = std::max(largest, out[i].finish_doubt);
    out[i].finish_doubt = finishDoubt(largest, begin + i + 1);
  }
}

double alphaInDouble(const VisibleSplat& splat, const Tile& tile, uint32_t x, uint32_t y) {
  const Footprint<double>& f = splat.footprint;
  const double dx = tile.x0 + x + 0.5 - f.mean_x;
  const double dy = tile.y0 + y + 0.5 - f.mean_y;
  // As the reference: the bounds are exact, and cheaper than an exponential.
  if (std::abs(dx) > splat.half_x || std::abs(dy) > splat.half_y) return 0.0;
  return splatAlpha(f.opacity, halfSquaredDistance(f, dx, dy));
}

void clearPixels(const Tile& tile, TilePixels& pixels) {
  std::fill(std::begin(pixels.transmittance), std::end(pixels.transmittance), 1.0f);
  for (float* plane :
       {pixels.red, pixels.green, pixels.blue, pixels.weighted_depth, pixels.count, pixels.doubt}) {
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
