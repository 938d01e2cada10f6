#include "splat/cpu/tile.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace stipple {

namespace {

/// Above this size of |g|, float32 leaves too few digits (error of alpha up to about 1e-4): only
/// splats thinner than a quarter of a pixel, which LowPass::kNone alone has.
constexpr double kMaxFloatReach = 200.0;

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
  TileSplat out;
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
  out.doubt_high = largest > kMaxFloatReach ? kFinished : out.doubt_low;
  std::copy(splat.colour, splat.colour + 3, out.colour);
  out.depth = splat.depth;
  out.row_begin = static_cast<uint32_t>(std::clamp(std::ceil(-dy - splat.half_y), 0.0, kSide));
  out.row_end = static_cast<uint32_t>(std::clamp(std::floor(-dy + splat.half_y) + 1.0, 0.0, kSide));
  return out;
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
    }
  }
  pixels.unfinished = tile.width * tile.height;
}

}  // namespace stipple
