#include <algorithm>
#include <numeric>

#include "splat/render/double_pixel.h"
#include "splat/render/object_order.h"
#include "splat/render/pixel_passes.h"
#include "splat/render/render.h"
#include "splat/render/scene.h"
#include "splat/render/splat_normal.h"

// The definition of correct: every visible splat in order at every pixel, in double.

namespace stipple {

namespace {

struct ReferenceSplat {
  Projected<double> projected;
  double colour[3];
  uint32_t key;
  bool is_holdout;
  Vec3d normal;
  uint32_t object;
};

std::vector<ReferenceSplat> visibleInOrder(const PlacedScene& scene, bool with_normal) {
  std::vector<ReferenceSplat> splats;
  for (const PlacedCloud& placed : scene.clouds) {
    for (size_t i = 0; i < placed.cloud->size(); ++i) {
      ReferenceSplat splat;
      if (!projectSplat(scene, placed, i, splat.projected)) continue;
      splatColour(scene, placed, i, splat.colour);
      splat.key = depthKey(splat.projected.depth);
      splat.is_holdout = placed.is_holdout;
      splat.normal = with_normal ? splatNormal(scene, placed, i) : Vec3d(0, 0, 0);
      splat.object = static_cast<uint32_t>(placed.instance) + 1;
      if (splat.is_holdout) std::fill(splat.colour, splat.colour + 3, 0.0);
      splats.push_back(splat);
    }
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const ReferenceSplat& a, const ReferenceSplat& b) { return a.key < b.key; });
  if (scene.objects_apart) {
    std::vector<size_t> object_of(scene.clouds.back().instance + 1);
    for (size_t k = 0; k < scene.clouds.size(); ++k) object_of[scene.clouds[k].instance] = k;
    const std::vector<ReferenceSplat> by_depth = splats;
    sortByObject<ReferenceSplat>(
        scene, by_depth, [&](const ReferenceSplat& splat) { return object_of[splat.object - 1]; },
        splats.data());
  }
  return splats;
}

}  // namespace

ReferenceResult renderReference(std::span<const SplatInstance> instances, const Camera& camera,
                                const RenderOptions& options, Progress* progress) {
  const PlacedScene scene = placeScene(instances, camera, options);
  advance(progress, 0.0, "Projecting splats");
  const std::vector<ReferenceSplat> splats = visibleInOrder(scene, options.with_normal);

  ReferenceResult result;
  sizeResult(camera, options, result);
  std::vector<const ReferenceSplat*> row;
  PixelPasses passes;
  for (uint32_t y = 0; y < camera.height; ++y) {
    advance(progress, static_cast<double>(y) / camera.height, "Rendering the reference");
    const double py = y + 0.5;
    // Leaving out splats beyond half_y, and below beyond half_x, cannot change the picture: their
    // alpha there is under the least and splatAlpha would skip them.
    row.clear();
    for (const ReferenceSplat& splat : splats) {
      const Projected<double>& p = splat.projected;
      if (std::abs(py - p.footprint.mean_y) <= p.half_y) row.push_back(&splat);
    }
    for (uint32_t x = 0; x < camera.width; ++x) {
      const double px = x + 0.5;
      const size_t i = static_cast<size_t>(y) * camera.width + x;
      DoublePixel pixel(options, i);
      passes.clear();
      for (const ReferenceSplat* splat : row) {
        const Projected<double>& p = splat->projected;
        const double dx = px - p.footprint.mean_x;
        if (std::abs(dx) > p.half_x) continue;
        const double alpha = splatAlpha(
            p.footprint.opacity, halfSquaredDistance(p.footprint, dx, py - p.footprint.mean_y),
            options.least_alpha);
        if (!(alpha > 0)) continue;
        if (!pixel.add(alpha, splat->colour, p.depth, splat->is_holdout)) break;
        if (!splat->is_holdout) passes.add(pixel.weight(), splat->normal, splat->object);
      }
      pixel.write(options, i, result);
      passes.write(options, i, pixel.ownSurfaceWeight(), result);
    }
  }
  finishSurface(options, result);
  advance(progress, 1.0, "Rendering the reference");
  return result;
}

}  // namespace stipple
