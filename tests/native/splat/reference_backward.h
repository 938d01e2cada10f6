#pragma once

#include <algorithm>
#include <vector>

#include "splat/projection_backward_matrices.h"
#include "splat/render/blend_backward.h"
#include "splat/render/render_backward.h"

// One cloud backwards in double: no tiles, no lists, no SIMD. It judges how the tiled pass decides
// and adds; the formulas that both share are judged by differences.

namespace stipple::testing {

struct ReferenceSplat {
  Projected<double> projected;
  double colour[3];
  size_t index;
  uint32_t key;
  double sums[kMostFields] = {};
};

inline std::vector<ReferenceSplat> visibleInOrder(const PlacedScene& scene) {
  std::vector<ReferenceSplat> splats;
  for (const PlacedCloud& placed : scene.clouds) {
    for (size_t i = 0; i < placed.cloud->size(); ++i) {
      ReferenceSplat splat;
      if (!projectSplat(scene, placed, i, splat.projected)) continue;
      // As the tiled renderer stores colours.
      float colour[3];
      splatColour(scene, placed, i, colour);
      std::copy(colour, colour + 3, splat.colour);
      splat.index = i;
      splat.key = depthKey(splat.projected.depth);
      splats.push_back(splat);
    }
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const ReferenceSplat& a, const ReferenceSplat& b) { return a.key < b.key; });
  return splats;
}

/// Adds one pixel's share to the sums of its splats. The loss has gradient [4] and residual [3],
/// and by_depth by the expected depth.
inline void takeOffPixel(std::vector<ReferenceSplat>& splats, double px, double py,
                         PixelLoss<double> loss, double by_depth = 0) {
  constexpr double kGScale = 0.84932180028801904;  // sqrt(log2(e)/2)
  struct Blended {
    ReferenceSplat* splat;
    SplatAtPixel<double> here;
  };
  std::vector<Blended> blended;
  PixelBlend<double> blend;
  for (ReferenceSplat& splat : splats) {
    const Footprint<double>& f = splat.projected.footprint;
    const double dx = px - f.mean_x;
    const double dy = py - f.mean_y;
    const double half = halfSquaredDistance(f, dx, dy);
    SplatAtPixel<double> here{};
    here.alpha = splatAlpha(f.opacity, half);
    if (!(here.alpha > 0)) continue;
    blend.add(here.alpha, splat.colour, splat.projected.depth);
    if (blend.finished) break;
    here.held = !(f.opacity * std::exp(-half) < kMaxAlpha);
    here.l00 = kGScale * f.l00;
    here.l10 = kGScale * f.l10;
    here.l11 = kGScale * f.l11;
    here.g0 = here.l00 * dx;
    here.g1 = here.l10 * dx + here.l11 * dy;
    std::copy(splat.colour, splat.colour + 3, here.colour);
    here.depth = splat.projected.depth;
    blended.push_back({&splat, here});
  }
  if (blend.count > 0) {
    loss.depth = blend.weighted_depth / (1.0 - blend.transmittance);
    loss.depth_gradient = by_depth / (1.0 - blend.transmittance);
  }
  PixelBackward<double> pixel{blend.transmittance, 0.0, {0.0, 0.0, 0.0}};
  for (size_t k = blended.size(); k-- > 0;) {
    takeOff(blended[k].here, loss, {BackwardMode::kStatistics, true}, pixel,
            blended[k].splat->sums);
  }
}

/// The tiled pass over nothing, with every statistic; residual [H,W,3], depth_gradient [H,W].
inline SplatGradients backwardReference(const SplatCloud& cloud, const Camera& camera,
                                        const RenderOptions& options,
                                        const std::vector<float>& gradient,
                                        const std::vector<float>& residual,
                                        const std::vector<float>& depth_gradient = {}) {
  const SplatInstance instance{&cloud};
  const PlacedScene scene = placeScene({&instance, 1}, camera, options);
  std::vector<ReferenceSplat> splats = visibleInOrder(scene);
  for (uint32_t y = 0; y < camera.height; ++y) {
    for (uint32_t x = 0; x < camera.width; ++x) {
      const size_t i = static_cast<size_t>(y) * camera.width + x;
      PixelLoss<double> loss{};
      for (size_t c = 0; c < 4; ++c) loss.gradient[c] = static_cast<double>(gradient[i * 4 + c]);
      for (size_t c = 0; c < 3; ++c) {
        const double r = static_cast<double>(residual[i * 3 + c]);
        loss.signed_weight[c] = r < 0 ? -1.0 : 1.0;
        loss.room[c] = 2.0 * std::abs(r);
      }
      takeOffPixel(splats, x + 0.5, y + 0.5, loss,
                   depth_gradient.empty() ? 0.0 : static_cast<double>(depth_gradient[i]));
    }
  }
  SplatGradients out;
  const size_t count = cloud.size();
  out.positions.resize(count * 3);
  out.rotations.resize(count * 4);
  out.scales.resize(count * 3);
  out.opacities.resize(count);
  out.sh.resize(cloud.sh.size());
  out.contributions.resize(count);
  out.blending_weights.resize(count);
  out.screen_gradient_norms.resize(count);
  for (const ReferenceSplat& splat : splats) {
    const size_t i = splat.index;
    const double scale = std::sqrt(kSquaredGScale);
    FootprintMatrices by_footprint;
    by_footprint.s = splat.sums[kFieldS];
    by_footprint.first = scale * Vec2d(splat.sums[kFieldG0], splat.sums[kFieldG1]);
    by_footprint.second << splat.sums[kFieldG00], splat.sums[kFieldG01], splat.sums[kFieldG01],
        splat.sums[kFieldG11];
    by_footprint.second *= kSquaredGScale;
    by_footprint.depth = splat.sums[kMostFields - 1];
    const PlacedCloud& placed = scene.clouds[0];
    const ProjectionVectors by =
        projectBackward(scene.view, placed.linear, placed.translation, &cloud.positions[i * 3],
                        &cloud.rotations[i * 4], &cloud.scales[i * 3], cloud.opacities[i],
                        placed.low_pass, by_footprint);
    const Vec3d by_direction = splatColourBackward(scene, placed, i, splat.sums + kFieldRed,
                                                   &out.sh[i * cloud.shStride()]);
    for (size_t axis = 0; axis < 3; ++axis) {
      const int a = static_cast<int>(axis);
      out.positions[i * 3 + axis] = storedGradient(by.position[a] + by_direction[a]);
      out.scales[i * 3 + axis] = storedGradient(by.scales[a]);
    }
    for (size_t k = 0; k < 4; ++k) {
      out.rotations[i * 4 + k] = storedGradient(by.rotation[static_cast<int>(k)]);
    }
    out.opacities[i] = storedGradient(by.opacity);
    out.contributions[i] = storedGradient(splat.sums[kFieldContribution]);
    out.blending_weights[i] = storedGradient(splat.sums[kFieldWeight]);
    out.screen_gradient_norms[i] = storedGradient(splat.sums[kFieldNorm]);
  }
  return out;
}

}  // namespace stipple::testing
