#include "train/loop/visibility.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "math/covariance.h"
#include "splat/render/projection.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 2048;
/// A splat shows nothing beyond sqrt(2 ln 255) = 3.33 standard deviations of its longest axis, in
/// the picture magnified by at most 1 + |slope|, slopes held to 1.3 of those at the borders.
constexpr double kReach = 3.4;
constexpr double kLowPassPixels = 3;  ///< more than the reach of the low-pass

/// Sum of alpha over the pixels of a view with nothing in front, by the area of the projected
/// Gaussian in the middle of its pixels, clamps left out; the picture's borders cut nothing off.
double unhiddenWeight(const Projected<double>& splat) {
  const Footprint<double>& f = splat.footprint;
  return 2 * std::numbers::pi * f.opacity / (f.l00 * f.l11);
}

/// A cheap bound: false only for splats that show nothing in a picture.
bool mayShow(const View<double>& view, const Vec3d& centre, const float* scales) {
  if (!(centre[2] >= view.near_plane && centre[2] <= view.far_plane)) return false;
  if (!view.perspective) return true;
  const double longest = static_cast<double>(std::max({scales[0], scales[1], scales[2]}));
  const double focal[2] = {view.fx, view.fy};
  const double middle[2] = {view.cx, view.cy};
  const double size[2] = {view.width, view.height};
  for (size_t axis = 0; axis < 2; ++axis) {
    const double steepest =
        std::max(std::abs(view.slope_min[axis]), std::abs(view.slope_max[axis]));
    const double magnified = focal[axis] * (1 + steepest) * longest / centre[2];
    const double reach = kReach * magnified + kLowPassPixels;
    const double place = focal[axis] * centre[static_cast<int>(axis)] / centre[2] + middle[axis];
    if (place + reach < 0 || place - reach > size[axis]) return false;
  }
  return true;
}

/// The same splats in a medium grey, seen alike from everywhere.
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
  // The derivative of the sum of a picture's red by a splat's constant harmonic is what it adds
  // where all are grey: the cheapest of the backward passes, and harmonics above need no look.
  const SplatCloud grey = withoutColours(cloud);
  const std::unique_ptr<ViewPass> pass = backends.makeViewPass();
  SplatCloud gradients;
  std::vector<float> red;
  for (size_t v = 0; v < views.size(); ++v) {
    advance(progress, static_cast<double>(v) / static_cast<double>(views.size()),
            "Looking at the splats");
    const Camera& camera = views[v];
    red.assign(size_t{4} * camera.width * camera.height, 0.0f);
    for (size_t i = 0; i < red.size(); i += 4) red[i] = 1.0f;
    pass->forward(grey, camera, options);
    pass->setLossGradient(red);
    pass->backward({});
    pass->swapGradients(gradients);
    const std::vector<float>& by_colour = gradients.sh;
    const View<double> view = makeView<double>(camera);
    const Mat3d linear = camera.world_to_camera.topLeftCorner<3, 3>();
    const Vec3d translation = camera.world_to_camera.topRightCorner<3, 1>();
    const LowPass low_pass = cloud.antialias == Antialias::kMip ? LowPass::kMip : LowPass::kClassic;
    parallelFor(count, kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float* p = &cloud.positions[i * 3];
        const Vec3d centre = linear * Vec3d(p[0], p[1], p[2]) + translation;
        if (!mayShow(view, centre, &cloud.scales[i * 3])) continue;
        Projected<double> projected;
        if (!project(view, linear, translation, &cloud.positions[i * 3], &cloud.rotations[i * 4],
                     &cloud.scales[i * 3], static_cast<double>(cloud.opacities[i]), low_pass,
                     projected)) {
          continue;
        }
        // Near views show a splat large without making it more important: areas, not pixels.
        const double pixel = view.perspective ? projected.depth / view.fx : 1 / view.fx;
        seen[i] +=
            static_cast<double>(by_colour[i * 3]) / static_cast<double>(kShC0) * pixel * pixel;
        whole[i] += unhiddenWeight(projected) * pixel * pixel;
      }
    });
    pass->swapGradients(gradients);
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
  const uint64_t gradient = uint64_t{view_size} * view_size * (4 * sizeof(float));
  return backends.passMemory(cloud, camera, {}) + gradient +
         cloud.size() * (2 * sizeof(double) + 15 * sizeof(float)) + (uint64_t{1} << 16);
}

}  // namespace stipple
