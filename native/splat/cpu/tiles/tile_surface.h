#pragma once

#include "splat/cpu/tiles/tile.h"
#include "splat/cpu/tiles/tile_holdouts.h"
#include "splat/render/render.h"

namespace stipple {

/// Puts the layer's part of a tile into pixels that clearPixels has cleared. Splats of the list
/// that are behind an opaque surface at every pixel are taken off its end.
void takeSurface(const SurfaceLayer& surface, const VisibleSplat* visible, Tile& tile,
                 TilePixels& pixels);

/// Behind the last splat: the surface of every pixel that it has not come to yet. In: with_extras,
/// as TileKernelOptions.
void endWithSurface(const SurfaceLayer& surface, const Tile& tile, bool with_extras,
                    TilePixels& pixels);

/// The tile's colour, depth and surface weight over what was written without a surface; the median
/// depth, counts and transmittance are right as they were. In: shares, of holdouts, or null for
/// none.
void writeWithSurface(const Tile& tile, const TilePixels& pixels, const TilePixels* shares,
                      const RenderOptions& options, RenderResult& result);

}  // namespace stipple
