#pragma once

#include <algorithm>
#include <cmath>

#include "math/camera.h"
#include "math/covariance.h"
#include "math/vec.h"
#include "splat/render/blend.h"
#include "splat/render/render.h"

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
  bool perspective;  ///< rays come from one point: all models but the orthographic
  bool is_wide;      ///< directions instead of a plane: nothing of the projection below applies
  T fx, fy, cx, cy;
  T width, height;
  T near_plane, far_plane;
  T least_alpha = T(kMinAlpha);  ///< fainter splats are skipped
  // x/z and y/z in the Jacobian are held inside the picture's own frustum, widened about its middle
  // by 1.3 (so for a centred camera |x/z| <= 1.3 tan(fov/2), as splats are trained). An off-centre
  // camera has its limits about the middle of the picture, not about the optical axis.
  T slope_min[2];
  T slope_max[2];
};

template <typename T>
View<T> makeView(const Camera& camera) {
  View<T> view{};
  view.perspective = camera.model != CameraModel::kOrthographic;
  view.is_wide = !hasImagePlane(camera);
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
  T half_x;  ///< pixels: |dx| of every pixel with the least alpha or more is at most this
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
T pick(bool condition, T yes, T no) {
  return condition ? yes : no;
}

/// Splats thinner than this in the picture, pixels, are not drawn; only LowPass::kNone has such.
constexpr double kMinWidth = 1e-6;

/// What the projection reads of a splat.
template <typename T>
struct SplatGeometry {
  T position[3];  ///< object space
  T rotation[4];  ///< w,x,y,z
  T scales[3];
  T opacity;
};

#include "splat/render/projection_steps-inl.h"

template <typename T>
CovarianceFactor<T> factorise(const Eigen::Matrix<T, 2, 3>& a, T variance) {
  const T x[3] = {a(0, 0), a(0, 1), a(0, 2)};
  const T y[3] = {a(1, 0), a(1, 1), a(1, 2)};
  const CovarianceFactor<T> factor = factoriseRows(x, y, std::sqrt(variance));
  if (!(factor.r00 > T(0))) return {T(0), T(0), T(0)};
  return factor;
}

/// Projects splat (position [3] object space, rotation w,x,y,z, scales [3]) under the
/// object-to-view matrix linear|translation. Returns false where the splat cannot show: centre
/// outside near..far, alpha below the least everywhere, outside the picture, thinner than
/// kMinWidth.
template <typename T>
bool project(const View<T>& view, const Eigen::Matrix<T, 3, 3>& linear,
             const Eigen::Matrix<T, 3, 1>& translation, const float* position,
             const float* rotation, const float* scales, T opacity, LowPass low_pass,
             Projected<T>& out) {
  SplatGeometry<T> splat;
  std::copy(position, position + 3, splat.position);
  std::copy(rotation, rotation + 4, splat.rotation);
  std::copy(scales, scales + 3, splat.scales);
  splat.opacity = opacity;
  if (!(splat.opacity >= view.least_alpha)) return false;
  T centre[3];
  placePoint(linear, translation, splat.position, centre);
  if (!(centre[2] >= view.near_plane && centre[2] <= view.far_plane)) return false;
  if (!(projectSteps(view, linear, centre, splat, low_pass, out) > T(kMinWidth))) return false;
  const Footprint<T>& f = out.footprint;
  return f.opacity >= view.least_alpha && f.mean_x + out.half_x >= T(0.5) &&
         f.mean_x - out.half_x <= view.width - T(0.5) && f.mean_y + out.half_y >= T(0.5) &&
         f.mean_y - out.half_y <= view.height - T(0.5);
}

}  // namespace stipple
