#pragma once

#include "splat/cpu/reused_array.h"
#include "splat/cpu/tiles/tile.h"
#include "splat/render/render.h"

namespace stipple {

/// What passes show of every visible splat, by slot; empty for passes that are not asked for.
struct PassSplats {
  ReusedArray<float> normals;     ///< 3 each
  ReusedArray<uint32_t> objects;  ///< 1 + the instance; 0 of a holdout

  uint64_t bytes() const { return normals.bytes() + objects.bytes(); }
};

/// Cost: O(visible splats), some 2 microseconds each for normals.
void findPassSplats(const PlacedScene& scene, const VisibleSplats& visible,
                    const RenderOptions& options, PassSplats& out);

/// Bytes that it allocates at most.
uint64_t passSplatsBound(uint64_t splat_count, const RenderOptions& options);

/// Objects among the splats of a tile, ascending.
std::vector<uint32_t> objectsOf(const Tile& tile, const PassSplats& passes);

/// In: blended, the tile with normals for colours.
void writeNormals(const Tile& tile, const TilePixels& blended, RenderResult& result);

/// Finds the objects that weigh most, three at a time.
class TileObjects {
 public:
  TileObjects();

  /// In: blended, the tile with red, green and blue 1 where a splat is of objects[0..2], which
  /// ascend from call to call; 0 for none.
  void take(const TilePixels& blended, const uint32_t (&objects)[3]);

  /// In: last, the tile as it was blended last, for the surface.
  void write(const Tile& tile, const TilePixels& last, const RenderOptions& options,
             RenderResult& result) const;

 private:
  float most_[kTilePixelCount];
  uint32_t best_[kTilePixelCount];
};

}  // namespace stipple
