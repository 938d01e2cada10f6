#include "splat/render/object_order.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "splat/render/surface.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 15;

double meanDepth(const View<double>& view, const PlacedCloud& placed) {
  const SplatCloud& cloud = *placed.cloud;
  std::vector<double> sums(rangeCount(cloud.size(), kGrain));
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    double sum = 0;
    for (size_t i = begin; i < end; ++i) {
      const float* at = &cloud.positions[i * 3];
      const Vec3d centre{static_cast<double>(at[0]), static_cast<double>(at[1]),
                         static_cast<double>(at[2])};
      const Vec3d seen = placed.linear * centre + placed.translation;
      sum += view.is_wide ? seen.norm() : seen[2];
    }
    sums[begin / kGrain] = sum;
  });
  double sum = 0;
  for (const double part : sums) sum += part;
  // Rows that are not finite are refused where they are read to be drawn.
  return std::isfinite(sum) ? sum / static_cast<double>(cloud.size()) : 0.0;
}

void refuseSurface(const SurfaceLayer& surface) {
  const size_t count = static_cast<size_t>(surface.width) * surface.height;
  if (!surface.depth || std::none_of(surface.depth, surface.depth + count,
                                     [](float depth) { return depth < kEmptyDepth; })) {
    return;
  }
  fail(ErrorCode::kUnsupported,
       "objects are drawn one after the other, and a surface stands between their splats; without "
       "global ordering no mesh can hide splats");
}

}  // namespace

void orderObjects(const RenderOptions& options, PlacedScene& scene) {
  scene.drawn_order.clear();
  scene.objects_apart = options.object_order == ObjectOrder::kApart && scene.clouds.size() > 1;
  if (!scene.objects_apart) return;
  refuseSurface(options.surface);
  std::vector<double> depths;
  for (const PlacedCloud& placed : scene.clouds) {
    scene.drawn_order.push_back(depths.size());
    depths.push_back(meanDepth(scene.view, placed));
  }
  std::stable_sort(scene.drawn_order.begin(), scene.drawn_order.end(),
                   [&](size_t a, size_t b) { return depths[a] < depths[b]; });
}

}  // namespace stipple
