#pragma once

#include <algorithm>
#include <cmath>

#include "math/camera.h"
#include "math/covariance.h"
#include "math/vec.h"
#include "splat/blend.h"
#include "splat/render.h"

// Projection of one splat to its footprint in the picture.
// Based on: Zwicker et al., EWA Volume Splatting, Visualization 2001 (the affine approximation);
// Yu, Chen, Huang, Sattler and Geiger, Mip-Splatting, CVPR 2024 (compensation of the low-pass).
// Differs: the covariance is never formed. With A = J W M R S (2x3), the rows of [A | s I], s^2 the
// low-pass, are made orthogonal (Gram-Schmidt), which gives the Cholesky factor of the covariance
// to the precision of T times its aspect ratio instead of the ratio's square: needles stay exact.

namespace stipple {

/// What the projection needs to know of the camera.
template <typename T>
struct View {
  bool perspective;
  T fx, fy, cx, cy;
  T width, height;
  T near_plane, far_plane;
  // x/z and y/z in the Jacobian are held inside the picture's own frustum, widened about its middle
  // by 1.3 (so for a centred camera |x/z| <= 1.3 tan(fov/2), as splats are trained). An off-centre
  // camera has its limits about the middle of the picture, not about the optical axis.
  T slope_min[2];
  T slope_max[2];
};

template <typename T>
View<T> makeView(const Camera& camera) {
  View<T> view{};
  view.perspective = camera.model == CameraModel::kPerspective;
  view.fx = T(camera.fx);
  view.fy = T(camera.fy);
  view.cx = T(camera.cx);
  view.cy = T(camera.cy);
  view.width = T(camera.width);
  view.height = T(camera.height);
  view.near_plane = T(camera.near_plane);
  view.far_plane = T(camera.far_plane);
  const T size[2] = {view.width, view.height};
  const T focal[2] = {view.fx, view.fy};
  const T centre[2] = {view.cx, view.cy};
  for (int axis = 0; axis < 2; ++axis) {
    const T middle = (T(0.5) * size[axis] - centre[axis]) / focal[axis];
    const T half = T(0.5) * size[axis] / focal[axis];
    view.slope_min[axis] = middle - T(1.3) * half;
    view.slope_max[axis] = middle + T(1.3) * half;
  }
  return view;
}

/// A footprint with what culling and sorting need.
template <typename T>
struct Projected {
  Footprint<T> footprint;
  T half_x;  ///< pixels: |dx| of every pixel with alpha >= 1/255 is at most this
  T half_y;
  T depth;  ///< view z of the centre, metres
};

/// Variance that the low-pass adds, px^2.
template <typename T>
T lowPassVariance(LowPass low_pass) {
  return low_pass == LowPass::kNone ? T(0) : low_pass == LowPass::kMip ? T(0.1) : T(0.3);
}

/// Cholesky factor [r00 0; r01 r11] of A A^T + variance I, from the rows of A.
template <typename T>
struct CovarianceFactor {
  T r00, r01, r11;
};

template <typename T>
CovarianceFactor<T> factorise(const Eigen::Matrix<T, 2, 3>& a, T variance) {
  using Row = Eigen::Matrix<T, 1, 5>;
  const T s = std::sqrt(variance);
  Row x, y;
  x << a(0, 0), a(0, 1), a(0, 2), s, T(0);
  y << a(1, 0), a(1, 1), a(1, 2), T(0), s;
  CovarianceFactor<T> factor;
  factor.r00 = x.norm();
  if (!(factor.r00 > T(0))) return {T(0), T(0), T(0)};
  x /= factor.r00;
  factor.r01 = x.dot(y);
  factor.r11 = (y - factor.r01 * x).norm();
  return factor;
}

/// Splats thinner than this in the picture, pixels, are not drawn; only LowPass::kNone has such.
constexpr double kMinWidth = 1e-6;

/// Room for rounding in every bound of where a splat shows, pixels. Bounds only save work: a pixel
/// inside them is still decided by splatAlpha.
template <typename T>
T boundMargin(T bound) {
  return T(0.01) + T(1e-7) * std::abs(bound);
}

/// Projects splat (position [3] object space, rotation w,x,y,z, scales [3]) under the
/// object-to-view matrix linear|translation. Returns false where the splat cannot show: centre
/// outside near..far, alpha below 1/255 everywhere, outside the picture, thinner than kMinWidth.
template <typename T>
bool project(const View<T>& view, const Eigen::Matrix<T, 3, 3>& linear,
             const Eigen::Matrix<T, 3, 1>& translation, const float* position,
             const float* rotation, const float* scales, float opacity, LowPass low_pass,
             Projected<T>& out) {
  if (!(T(opacity) >= T(kMinAlpha))) return false;
  const Eigen::Matrix<T, 3, 1> centre =
      linear * Eigen::Matrix<T, 3, 1>(T(position[0]), T(position[1]), T(position[2])) + translation;
  const T z = centre[2];
  if (!(z >= view.near_plane && z <= view.far_plane)) return false;

  const Eigen::Matrix<T, 3, 3> axes = linear * scaledAxes<T>(rotation, scales);
  Eigen::Matrix<T, 2, 3> a;
  Footprint<T>& footprint = out.footprint;
  if (view.perspective) {
    const T slope_x = centre[0] / z;
    const T slope_y = centre[1] / z;
    footprint.mean_x = view.fx * slope_x + view.cx;
    footprint.mean_y = view.fy * slope_y + view.cy;
    const T held_x = std::clamp(slope_x, view.slope_min[0], view.slope_max[0]);
    const T held_y = std::clamp(slope_y, view.slope_min[1], view.slope_max[1]);
    a.row(0) = (view.fx / z) * (axes.row(0) - held_x * axes.row(2));
    a.row(1) = (view.fy / z) * (axes.row(1) - held_y * axes.row(2));
  } else {
    footprint.mean_x = view.fx * centre[0] + view.cx;
    footprint.mean_y = view.fy * centre[1] + view.cy;
    a.row(0) = view.fx * axes.row(0);
    a.row(1) = view.fy * axes.row(1);
  }

  const CovarianceFactor<T> factor = factorise(a, lowPassVariance<T>(low_pass));
  if (!(factor.r00 > T(kMinWidth) && factor.r11 > T(kMinWidth))) return false;
  footprint.opacity = T(opacity);
  if (low_pass == LowPass::kMip) {
    const CovarianceFactor<T> sharp = factorise(a, T(0));
    footprint.opacity *= (sharp.r00 / factor.r00) * (sharp.r11 / factor.r11);
    if (!(footprint.opacity >= T(kMinAlpha))) return false;
  }
  footprint.l00 = T(1) / factor.r00;
  footprint.l11 = T(1) / factor.r11;
  footprint.l10 = -(factor.r01 / factor.r00) / factor.r11;

  // q/2 <= ln(255 o) is an ellipse; its half sides are sqrt(2 ln(255 o)) standard deviations.
  const T reach = std::sqrt(T(2) * std::log(footprint.opacity / T(kMinAlpha)));
  const T sigma_y = std::sqrt(factor.r01 * factor.r01 + factor.r11 * factor.r11);
  out.half_x = reach * factor.r00 + boundMargin(reach * factor.r00);
  out.half_y = reach * sigma_y + boundMargin(reach * sigma_y);
  out.depth = z;
  return footprint.mean_x + out.half_x >= T(0.5) &&
         footprint.mean_x - out.half_x <= view.width - T(0.5) &&
         footprint.mean_y + out.half_y >= T(0.5) &&
         footprint.mean_y - out.half_y <= view.height - T(0.5);
}

}  // namespace stipple
