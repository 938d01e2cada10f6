#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <vector>

#include "splat/cpu/tiles/tile.h"

namespace stipple {

/// Most splats that a TileSplatMaker makes at once.
constexpr size_t kTileSplatBatch = 128;
/// Columns of what depends on the tile: mean_x, mean_y, l00, l10, l11, half_y.
constexpr size_t kTileSplatFields = 6;
using TileSplatColumns = double[kTileSplatFields][kTileSplatBatch];

/// Makes splats begin .. begin + count, at most kTileSplatBatch, of the tile's list ready, except
/// for finish_doubt. Returns the largest size of g and l of all, not held to anything.
using TileSplatMaker = float (*)(const VisibleSplat* visible, const Tile& tile, size_t begin,
                                 size_t count, TileSplat* out);

struct NamedTileSplatMaker {
  const char* target;  ///< as NamedTileKernel::target
  TileSplatMaker make;
};

/// One splat after another; the vector targets give the same bits.
float makeTileSplatsScalar(const VisibleSplat* visible, const Tile& tile, size_t begin,
                           size_t count, TileSplat* out);

/// As chosenTileKernel() and tileKernels().
TileSplatMaker chosenTileSplatMaker();
std::vector<NamedTileSplatMaker> tileSplatMakers();

/// Brings the splats of a batch together: columns, and what a TileSplat takes over as it is.
inline void gatherTileSplats(const VisibleSplat* visible, const Tile& tile, size_t begin,
                             size_t count, TileSplatColumns& columns, TileSplat* out) {
  // A tile's splats lie far apart, so each would wait for memory.
  constexpr size_t kPrefetchDistance = 24;
  for (size_t i = 0; i < count; ++i) {
    const size_t ahead = std::min(begin + i + kPrefetchDistance, tile.splats.size() - 1);
    __builtin_prefetch(&visible[tile.splats[ahead]]);
    const VisibleSplat& splat = visible[tile.splats[begin + i]];
    columns[0][i] = splat.mean_x;
    columns[1][i] = splat.mean_y;
    columns[2][i] = splat.l00;
    columns[3][i] = splat.l10;
    columns[4][i] = splat.l11;
    columns[5][i] = static_cast<double>(splat.half_y);
    out[i].log2_opacity = splat.log2_opacity;
    out[i].depth = splat.depth;
    for (size_t c = 0; c < 3; ++c) out[i].colour[c] = splat.colour[c];
  }
}

}  // namespace stipple
