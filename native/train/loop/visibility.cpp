#include "train/loop/visibility.h"

#include <algorithm>

#include "base/parallel.h"
#include "splat/render/blend.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;

/// The same splats in a medium grey: harmonics need no look.
SplatCloud withoutColours(const SplatCloud& cloud) {
  SplatCloud grey;
  grey.positions = cloud.positions;
  grey.rotations = cloud.rotations;
  grey.scales = cloud.scales;
  grey.opacities = cloud.opacities;
  grey.sh.assign(cloud.size() * 3, 0.0f);
  grey.colour_space = cloud.colour_space;
  grey.antialias = cloud.antialias;
  return grey;
}

}  // namespace

std::vector<float> splatVisibility(const BackendFactory& backends, const SplatCloud& cloud,
                                   std::span<const Camera> views, Progress* progress) {
  const size_t count = cloud.size();
  std::vector<double> seen(count, 0.0);
  std::vector<double> whole(count, 0.0);
  RenderOptions options;
  options.with_depth = false;
  const SplatCloud grey = withoutColours(cloud);
  const std::unique_ptr<ViewPass> pass = backends.makeViewPass();
  for (size_t v = 0; v < views.size(); ++v) {
    advance(progress, static_cast<double>(v) / static_cast<double>(views.size()),
            "Looking at the splats");
    const Camera& camera = views[v];
    pass->forward(grey, camera, options);
    const ShownWeights shown = pass->shownWeights();
    const bool is_perspective = camera.model != CameraModel::kOrthographic;
    const Eigen::RowVector4d to_depth = camera.world_to_camera.row(2);
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!(shown.unhidden[i] > 0)) continue;
        // Near views show a splat large without making it more important: areas, not pixels.
        const float* p = &cloud.positions[i * 3];
        const double depth = to_depth * Eigen::Vector4d(p[0], p[1], p[2], 1);
        const double pixel = is_perspective ? depth / camera.fx : 1 / camera.fx;
        seen[i] += static_cast<double>(shown.seen[i]) * pixel * pixel;
        whole[i] += static_cast<double>(shown.unhidden[i]) * pixel * pixel;
      }
    });
  }
  std::vector<float> visibility(count);
  for (size_t i = 0; i < count; ++i) {
    const bool faint = static_cast<double>(cloud.opacities[i]) < kMinAlpha;
    const double unknown = faint ? 0.0 : 1.0;
    const double share = whole[i] > 0 ? seen[i] / whole[i] : unknown;
    visibility[i] = static_cast<float>(std::clamp(share, 0.0, 1.0));
  }
  return visibility;
}

uint64_t visibilityMemoryBound(const BackendFactory& backends, const SplatCloud& cloud,
                               uint32_t view_size) {
  Camera camera;
  camera.width = camera.height = view_size;
  camera.fx = camera.fy = view_size;
  return backends.passMemory(cloud, camera, {}) +
         cloud.size() * (2 * sizeof(double) + 16 * sizeof(float)) + (uint64_t{1} << 16);
}

}  // namespace stipple
