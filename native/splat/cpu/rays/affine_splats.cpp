#include "splat/cpu/rays/affine_splats.h"

#include <algorithm>
#include <cmath>

#include "splat/render/depth_order.h"

namespace stipple {

namespace {

/// Covariance of the projected coordinates with view z, brought through C^-1 = L^T L: what z gains
/// per pixel. At most sqrt(variance of z) times the Mahalanobis distance, however thin the splat.
void depthSlope(const View<double>& view, const Mat3d& linear, const double* centre,
                const SplatGeometry<double>& splat, const Footprint<double>& f, double* slope) {
  double own[3][3];
  scaledAxesSteps(splat.rotation, splat.scales, own);
  Mat3d axes;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      axes(i, k) = linear(i, 0) * own[0][k] + linear(i, 1) * own[1][k] + linear(i, 2) * own[2][k];
    }
  }
  double across[2] = {0, 0};  // covariances with z, pixels metres
  for (int axis = 0; axis < 2; ++axis) {
    const double focal = axis == 0 ? view.fx : view.fy;
    const double scale = view.perspective ? focal / centre[2] : focal;
    const double held = view.perspective ? std::clamp(centre[axis] / centre[2],
                                                      view.slope_min[axis], view.slope_max[axis])
                                         : 0.0;
    for (int k = 0; k < 3; ++k) {
      across[axis] += scale * (axes(axis, k) - held * axes(2, k)) * axes(2, k);
    }
  }
  const double u = f.l00 * across[0];
  const double v = f.l10 * across[0] + f.l11 * across[1];
  slope[0] = f.l00 * u + f.l10 * v;
  slope[1] = f.l11 * v;
}

}  // namespace

bool makeAffineSplat(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                     double least_alpha, AffineSplat& out) {
  const SplatCloud& cloud = *placed.cloud;
  const View<double>& view = scene.view;
  SplatGeometry<double> splat;
  std::copy_n(&cloud.positions[index * 3], 3, splat.position);
  std::copy_n(&cloud.rotations[index * 4], 4, splat.rotation);
  std::copy_n(&cloud.scales[index * 3], 3, splat.scales);
  splat.opacity = placed.opacity(index);
  if (!(splat.opacity >= least_alpha)) return false;
  double centre[3];
  placePoint(placed.linear, placed.translation, splat.position, centre);
  if (!(centre[2] >= view.near_plane && centre[2] <= view.far_plane)) return false;
  Projected<double> projected;
  if (!(projectSteps(view, placed.linear, centre, splat, placed.low_pass, projected) > kMinWidth)) {
    return false;
  }
  const Footprint<double>& f = projected.footprint;
  if (!(f.opacity >= least_alpha)) return false;
  out.footprint = f;
  const double reach = std::sqrt(2 * std::log(f.opacity / least_alpha));
  // C = R R^T, R = L^-1: its diagonal is that of the variances.
  const double r10 = -f.l10 / (f.l00 * f.l11);
  out.half_x = reach / f.l00;
  out.half_y = reach * std::sqrt(r10 * r10 + 1 / (f.l11 * f.l11));
  out.half_x += boundMargin(out.half_x);
  out.half_y += boundMargin(out.half_y);
  out.depth = projected.depth;
  depthSlope(view, placed.linear, centre, splat, f, out.slope);
  out.is_holdout = placed.is_holdout;
  return true;
}

std::vector<AffineSplat> affineSplats(const PlacedScene& scene, double least_alpha) {
  const View<double>& view = scene.view;
  return splatsInDepthOrder<AffineSplat>(
      scene,
      [&](const PlacedCloud& placed, size_t i, AffineSplat& splat) {
        if (!makeAffineSplat(scene, placed, i, least_alpha, splat)) return false;
        const Footprint<double>& f = splat.footprint;
        if (!(f.mean_x + splat.half_x >= 0.5 && f.mean_x - splat.half_x <= view.width - 0.5 &&
              f.mean_y + splat.half_y >= 0.5 && f.mean_y - splat.half_y <= view.height - 0.5)) {
          return false;
        }
        splatColour(scene, placed, i, splat.colour);
        if (splat.is_holdout) std::fill(splat.colour, splat.colour + 3, 0.0);
        return true;
      },
      [](const AffineSplat& splat) { return splat.depth; });
}

}  // namespace stipple
