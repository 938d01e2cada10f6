#include "splat/cpu/tiles/tile_passes.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/splat_normal.h"
#include "splat/render/surface.h"

namespace stipple {

void findPassSplats(const PlacedScene& scene, const VisibleSplats& visible,
                    const RenderOptions& options, PassSplats& out) {
  if (!hasPasses(options)) return;
  const size_t slots = visible.splats.size();
  out.normals.resize(options.with_normal ? slots * 3 : 0);
  out.objects.resize(slots);
  parallelFor(visible.count, 1024, [&](size_t begin, size_t end) {
    for (size_t place = begin; place < end; ++place) {
      const uint32_t slot = visible.slotAt(place);
      const uint32_t index = visible.extras[slot].index;
      const PlacedCloud& placed = scene.clouds[cloudOfSplat(scene, index)];
      out.objects[slot] = placed.is_holdout ? 0 : static_cast<uint32_t>(placed.instance) + 1;
      if (!options.with_normal) continue;
      const Vec3d normal = splatNormal(scene, placed, index - placed.first_index);
      for (Eigen::Index k = 0; k < 3; ++k) {
        out.normals[size_t{slot} * 3 + static_cast<size_t>(k)] = static_cast<float>(normal[k]);
      }
    }
  });
}

uint64_t passSplatsBound(uint64_t splat_count, const RenderOptions& options) {
  if (!hasPasses(options)) return 0;
  constexpr uint64_t kRoundedUp = uint64_t{2} << 20;  // arrays on huge pages
  return splat_count * (sizeof(uint32_t) + (options.with_normal ? 3 * sizeof(float) : 0)) +
         2 * kRoundedUp;
}

std::vector<uint32_t> objectsOf(const Tile& tile, const PassSplats& passes) {
  std::vector<uint32_t> objects;
  uint32_t last = 0;
  for (const uint32_t slot : tile.splats) {
    const uint32_t object = passes.objects[slot];
    if (object == 0 || object == last) continue;
    last = object;
    const auto at = std::lower_bound(objects.begin(), objects.end(), object);
    if (at == objects.end() || *at != object) objects.insert(at, object);
  }
  return objects;
}

void writeNormals(const Tile& tile, const TilePixels& blended, RenderResult& result) {
  forEachPixel(tile, result.width, [&](size_t i, size_t at) {
    const Vec3d sum(static_cast<double>(blended.red[i]), static_cast<double>(blended.green[i]),
                    static_cast<double>(blended.blue[i]));
    const double length = sum.norm();
    for (Eigen::Index k = 0; k < 3; ++k) {
      result.normal[at * 3 + static_cast<size_t>(k)] =
          length > 0 ? static_cast<float>(sum[k] / length) : 0.0f;
    }
  });
}

TileObjects::TileObjects() {
  std::fill(most_, most_ + kTilePixelCount, 0.0f);
  std::fill(best_, best_ + kTilePixelCount, 0u);
}

void TileObjects::take(const TilePixels& blended, const uint32_t (&objects)[3]) {
  const float* planes[3] = {blended.red, blended.green, blended.blue};
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < kTilePixelCount; ++i) {
      if (!(planes[c][i] > most_[i])) continue;
      most_[i] = planes[c][i];
      best_[i] = objects[c];
    }
  }
}

void TileObjects::write(const Tile& tile, const TilePixels& last, const RenderOptions& options,
                        RenderResult& result) const {
  forEachPixel(tile, result.width, [&](size_t i, size_t at) {
    bool is_hidden = false;
    if (hasSurface(options) && options.surface.colour) {
      is_hidden = last.before[i] * surfaceAt<float>(options.surface, at).opacity >= most_[i];
    }
    result.objects[at] = is_hidden ? 0 : best_[i];
  });
}

}  // namespace stipple
