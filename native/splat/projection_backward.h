#pragma once

#include "math/quaternion_gradient.h"
#include "splat/projection.h"

// splat/projection.h backwards. The loss depends on a footprint through the pixels' offsets d from
// its centre; with e = L d, L L^T... the form |L d|^2 = d^T C^-1 d, and M = sum of s e e^T,
//   dL/dmean = L^T (sum of s e),   dL/dC = 1/2 L^T M L,   dL/dA = L^T M (L A)
// for C = A A^T + variance I. L A has rows of length <= 1, so needles lose no digits here either.

namespace stipple {

/// Derivatives by a footprint, as sums over its pixels: s = alpha dL/dalpha, e = L d.
struct FootprintGradient {
  double s;                ///< sum of s
  Vec2d first;             ///< sum of s e
  Eigen::Matrix2d second;  ///< sum of s e e^T
};

struct ProjectionGradient {
  Vec2d mean;  ///< by the projected centre, per pixel
  Vec3d position;
  Vec4d rotation;
  Vec3d scales;
  double opacity;
  Vec3d centre;  ///< by the centre in the camera's frame
  Vec3d turn;    ///< by a rotation about the camera's origin, radians
};

inline Vec3d crossProduct(const Vec3d& a, const Vec3d& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Inverse of the Cholesky factor: |L d|^2 = d^T C^-1 d.
inline Eigen::Matrix2d inverseFactor(const CovarianceFactor<double>& factor) {
  Eigen::Matrix2d l;
  l << 1.0 / factor.r00, 0.0, -(factor.r01 / factor.r00) / factor.r11, 1.0 / factor.r11;
  return l;
}

/// The derivative by what `project` reads. In: a splat that `project` accepts, and the derivatives
/// by its footprint.
inline ProjectionGradient projectBackward(const View<double>& view, const Mat3d& linear,
                                          const Vec3d& translation, const float* position,
                                          const float* rotation, const float* scales, float opacity,
                                          LowPass low_pass, const FootprintGradient& by_footprint) {
  using Matrix23 = Eigen::Matrix<double, 2, 3>;
  const Vec3d centre =
      linear * Vec3d(static_cast<double>(position[0]), static_cast<double>(position[1]),
                     static_cast<double>(position[2])) +
      translation;
  const Mat3d turned = rotationFromQuaternion<double>(rotation);
  Mat3d scaled = turned;
  for (int k = 0; k < 3; ++k) scaled.col(k) *= static_cast<double>(scales[k]);
  const Mat3d axes = linear * scaled;
  const double z = centre[2];
  double focal[2] = {view.fx, view.fy};
  double held[2] = {0.0, 0.0};
  bool is_held[2] = {true, true};
  if (view.perspective) {
    for (int axis = 0; axis < 2; ++axis) {
      const double slope = centre[axis] / z;
      held[axis] = std::clamp(slope, view.slope_min[axis], view.slope_max[axis]);
      is_held[axis] = held[axis] != slope;
      focal[axis] /= z;
    }
  }
  Matrix23 a;
  for (int axis = 0; axis < 2; ++axis) {
    a.row(axis) = focal[axis] * (axes.row(axis) - held[axis] * axes.row(2));
  }
  const Eigen::Matrix2d l = inverseFactor(factorise(a, lowPassVariance<double>(low_pass)));

  ProjectionGradient out;
  out.mean = l.transpose() * by_footprint.first;
  const Matrix23 whitened = l * a;
  Matrix23 by_a = l.transpose() * (by_footprint.second * whitened);
  if (low_pass == LowPass::kMip) {
    // ln of the compensation is 1/2 (ln det A A^T - ln det C).
    const Eigen::Matrix2d sharp = inverseFactor(factorise(a, 0.0));
    by_a += by_footprint.s * (sharp.transpose() * (sharp * a) - l.transpose() * whitened);
  }
  out.opacity = by_footprint.s / static_cast<double>(opacity);

  Mat3d by_axes = Mat3d::Zero();
  out.centre = Vec3d::Zero();
  for (int axis = 0; axis < 2; ++axis) {
    by_axes.row(axis) = focal[axis] * by_a.row(axis);
    out.centre[axis] = focal[axis] * out.mean[axis];
    if (!view.perspective) continue;
    by_axes.row(2) -= focal[axis] * held[axis] * by_a.row(axis);
    if (!is_held[axis]) out.centre[axis] -= focal[axis] / z * by_a.row(axis).dot(axes.row(2));
    out.centre[2] -= (out.centre[axis] * centre[axis] + by_a.row(axis).dot(a.row(axis))) / z;
  }
  out.turn = crossProduct(centre, out.centre);
  for (int k = 0; k < 3; ++k) out.turn += crossProduct(axes.col(k), by_axes.col(k));
  out.position = linear.transpose() * out.centre;
  Mat3d by_rotation = linear.transpose() * by_axes;
  for (int k = 0; k < 3; ++k) {
    out.scales[k] = by_rotation.col(k).dot(turned.col(k));
    by_rotation.col(k) *= static_cast<double>(scales[k]);
  }
  out.rotation = rotationGradientToQuaternion<double>(rotation, by_rotation);
  return out;
}

}  // namespace stipple
