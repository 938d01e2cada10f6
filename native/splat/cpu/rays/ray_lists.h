#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "splat/cpu/rays/ray_forms.h"
#include "splat/cpu/tiles/tile_grid.h"

namespace stipple {

/// Whole rows of tiles with the splats that may show in each, in the order in which they were
/// given.
struct RayTileBand {
  size_t first_tile = 0;
  size_t end_tile = 0;
  std::vector<uint64_t> offsets;  ///< [end_tile - first_tile + 1] into entries
  std::vector<uint32_t> entries;

  std::span<const uint32_t> tile(size_t index) const {
    const uint64_t begin = offsets[index - first_tile];
    return {entries.data() + begin, offsets[index - first_tile + 1] - begin};
  }
};

/// Lists the splats of every tile, and hands them to `use`, so many rows of tiles at a time that
/// the lists stay bounded. Same lists for any number of threads. In: reaches, of a perspective or
/// parallel view.
void forEachRayTileBand(const std::vector<RayReach>& reaches, const View<double>& view,
                        const TileGrid& grid, const std::function<void(const RayTileBand&)>& use);

/// Bytes that it allocates at most: for pairs of splat and tile, and for everything else.
struct RayListsBound {
  uint64_t pair_bytes;
  uint64_t other_bytes;
};
RayListsBound rayListsBound(uint64_t splat_count, const TileGrid& grid);

}  // namespace stipple
