#include "bench/splat_floor.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <vector>

#include "base/parallel.h"
#include "bench/exact_tiles.h"
#include "splat/cpu/tiles/tile.h"

namespace stipple::bench {

namespace {

/// Nanoseconds of the loop over all tiles, summed over threads.
uint64_t blendAllTiles(const VisibleSplats& visible, const TileGrid& grid, TileKernel kernel,
                       TileCulling culling) {
  TileKernelOptions options = {true, false};  // what RenderOptions{} asks for
  options.culling = culling;
  std::atomic<uint64_t> nanoseconds{0};
  forEachTileGroup(visible, grid, nullptr, [&](const TileListGroup& group) {
    parallelFor(group.end_tile - group.first_tile, 1, [&](size_t begin, size_t end) {
      thread_local std::vector<TileSplat> splats;
      for (size_t index = group.first_tile + begin; index < group.first_tile + end; ++index) {
        const Tile tile = tileOf(grid, index, group.tile(index));
        splats.resize(tile.splats.size());
        float largest = 0;
        makeTileSplats(visible.splats.get(), tile, 0, splats.size(), largest, splats.data());
        TilePixels pixels;
        clearPixels(tile, pixels);
        const auto start = std::chrono::steady_clock::now();
        kernel(splats.data(), splats.size(), options, pixels);
        const auto took = std::chrono::steady_clock::now() - start;
        nanoseconds += static_cast<uint64_t>(
            std::chrono::duration_cast<std::chrono::nanoseconds>(took).count());
      }
    });
  });
  return nanoseconds;
}

void countPairs(const VisibleSplats& visible, const TileGrid& grid, BlendFloor& floor) {
  std::vector<std::vector<uint32_t>> exact(grid.tileCount());
  std::vector<uint32_t> place_of(visible.splats.size());
  for (size_t i = 0; i < visible.count; ++i) {
    const uint32_t slot = visible.slotAt(i);
    place_of[slot] = static_cast<uint32_t>(i);
    forEachExactTile(visible.slots().footprint(slot), visible.extras[slot].half_x,
                     static_cast<double>(visible.splats[slot].half_y), grid,
                     [&](size_t tile) { exact[tile].push_back(static_cast<uint32_t>(i)); });
  }
  forEachTileGroup(visible, grid, nullptr, [&](const TileListGroup& group) {
    for (size_t tile = group.first_tile; tile < group.end_tile; ++tile) {
      const std::span<const uint32_t> listed = group.tile(tile);
      floor.listed_pairs += listed.size();
      floor.exact_pairs += exact[tile].size();
      // Both are in rising order.
      size_t at = 0;
      for (const uint32_t splat : exact[tile]) {
        while (at < listed.size() && place_of[listed[at]] < splat) ++at;
        floor.missing_pairs += at == listed.size() || place_of[listed[at]] != splat;
      }
    }
  });
}

}  // namespace

BlendFloor measureBlendFloor(std::span<const SplatInstance> instances, const Camera& camera,
                             TileKernel kernel, unsigned threads, int repeats) {
  const PlacedScene scene = placeScene(instances, camera, RenderOptions{});
  const VisibleSplats visible = findVisibleSplats(scene, nullptr);
  const TileGrid grid(camera.width, camera.height);
  BlendFloor floor;
  countPairs(visible, grid, floor);
  withThreads(threads, [&] {
    const auto best = [&](TileCulling culling, double& seconds) {
      const uint64_t nanoseconds = blendAllTiles(visible, grid, kernel, culling);
      seconds = std::min(seconds, 1e-9 * static_cast<double>(nanoseconds) / threads);
    };
    for (int i = 0; i < repeats; ++i) {
      best(TileCulling::kNothing, floor.seconds);
      best(TileCulling::kRows, floor.row_skip_seconds);
      best(TileCulling::kAll, floor.culled_seconds);
    }
  });
  return floor;
}

}  // namespace stipple::bench
