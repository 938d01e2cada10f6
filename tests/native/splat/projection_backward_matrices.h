#pragma once

#include <algorithm>
#include <cmath>

#include "math/quaternion_gradient.h"
#include "math/spherical_harmonics_gradient.h"
#include "splat/render/projection.h"
#include "splat/render/scene.h"
#include "splat/render/scene_backward.h"

// Projection and colours of a splat taken back with matrices, one splat at a time: what the steps
// of splat/cpu/back_projector-inl.h must give, derived in another notation.

namespace stipple::testing {

/// A float32 of any double: held to the largest that is finite.
inline float storedGradient(double value) {
  constexpr double kLargest = 3.4e38;
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

/// Derivatives by a footprint, as sums over its pixels: s = alpha dL/dalpha, e = L d.
struct FootprintMatrices {
  double s;                ///< sum of s
  Vec2d first;             ///< sum of s e
  Eigen::Matrix2d second;  ///< sum of s e e^T
  double depth;            ///< by the depth of the centre
};

struct ProjectionVectors {
  Vec2d mean;  ///< by the projected centre, per pixel
  Vec3d position;
  Vec4d rotation;
  Vec3d scales;
  double opacity;
  Vec3d centre;  ///< by the centre in the camera's frame
  Vec3d turn;    ///< by a rotation about the camera's origin, radians
};

using Real = long double;
using Real3 = Eigen::Matrix<Real, 3, 1>;
using Real33 = Eigen::Matrix<Real, 3, 3>;
using Real22 = Eigen::Matrix<Real, 2, 2>;
using Real23 = Eigen::Matrix<Real, 2, 3>;

inline Real3 crossProduct(const Real3& a, const Real3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Inverse of the Cholesky factor: |L d|^2 = d^T C^-1 d.
inline Real22 inverseFactor(const CovarianceFactor<Real>& factor) {
  Real22 l;
  l << 1.0L / factor.r00, 0.0L, -(factor.r01 / factor.r00) / factor.r11, 1.0L / factor.r11;
  return l;
}

/// The derivative by what `project` reads. In: a splat that `project` accepts, and the derivatives
/// by its footprint. In long double: L A loses as many digits as the splat's aspect ratio has.
inline ProjectionVectors projectBackward(const View<double>& view, const Mat3d& linear_part,
                                         const Vec3d& translation, const float* position,
                                         const float* rotation, const float* scales, float opacity,
                                         LowPass low_pass, const FootprintMatrices& by_footprint) {
  const Real33 linear = linear_part.cast<Real>();
  const Real3 centre =
      linear * Real3(position[0], position[1], position[2]) + translation.cast<Real>();
  const Real33 turned = rotationFromQuaternion<Real>(rotation);
  Real33 scaled = turned;
  for (int k = 0; k < 3; ++k) scaled.col(k) *= static_cast<Real>(scales[k]);
  const Real33 axes = linear * scaled;
  const Real z = centre[2];
  Real focal[2] = {view.fx, view.fy};
  Real held[2] = {0.0L, 0.0L};
  bool is_held[2] = {true, true};
  if (view.perspective) {
    for (int axis = 0; axis < 2; ++axis) {
      const Real slope = centre[axis] / z;
      held[axis] = std::clamp<Real>(slope, view.slope_min[axis], view.slope_max[axis]);
      is_held[axis] = held[axis] != slope;
      focal[axis] /= z;
    }
  }
  Real23 a;
  for (int axis = 0; axis < 2; ++axis) {
    a.row(axis) = focal[axis] * (axes.row(axis) - held[axis] * axes.row(2));
  }
  const Real22 l =
      inverseFactor(factorise(a, static_cast<Real>(lowPassVariance<double>(low_pass))));

  ProjectionVectors out;
  const Eigen::Matrix<Real, 2, 1> mean = l.transpose() * by_footprint.first.cast<Real>();
  const Real23 whitened = l * a;
  Real23 by_a = l.transpose() * (by_footprint.second.cast<Real>() * whitened);
  if (low_pass == LowPass::kMip) {
    // ln of the compensation is 1/2 (ln det A A^T - ln det C).
    const Real22 sharp = inverseFactor(factorise(a, 0.0L));
    by_a += static_cast<Real>(by_footprint.s) *
            (sharp.transpose() * (sharp * a) - l.transpose() * whitened);
  }

  Real33 by_axes = Real33::Zero();
  Real3 by_centre(0.0L, 0.0L, by_footprint.depth);
  for (int axis = 0; axis < 2; ++axis) {
    by_axes.row(axis) = focal[axis] * by_a.row(axis);
    by_centre[axis] = focal[axis] * mean[axis];
    if (!view.perspective) continue;
    by_axes.row(2) -= focal[axis] * held[axis] * by_a.row(axis);
    if (!is_held[axis]) by_centre[axis] -= focal[axis] / z * by_a.row(axis).dot(axes.row(2));
    by_centre[2] -= (by_centre[axis] * centre[axis] + by_a.row(axis).dot(a.row(axis))) / z;
  }
  Real3 turn = crossProduct(centre, by_centre);
  for (int k = 0; k < 3; ++k) turn += crossProduct(axes.col(k), by_axes.col(k));
  Real33 by_rotation = linear.transpose() * by_axes;
  for (int k = 0; k < 3; ++k) {
    out.scales[k] = static_cast<double>(by_rotation.col(k).dot(turned.col(k)));
    by_rotation.col(k) *= static_cast<Real>(scales[k]);
  }
  out.mean = mean.cast<double>();
  out.opacity = by_footprint.s / static_cast<double>(opacity);
  out.centre = by_centre.cast<double>();
  out.turn = turn.cast<double>();
  out.position = (linear.transpose() * by_centre).cast<double>();
  out.rotation = rotationGradientToQuaternion<Real>(rotation, by_rotation).cast<double>();
  return out;
}

/// In: dL/dcolour [3] of a splat in the blending space. Out: dL/dsh [shStride()] of its cloud.
/// Returns the derivative by the viewing direction before it is made unit, in object space: by the
/// position under a perspective camera. Where a colour is held at 0 nothing passes.
inline Vec3d splatColourBackward(const PlacedScene& scene, const PlacedCloud& placed, size_t index,
                                 const double* by_colour, float* by_sh) {
  const SplatCloud& cloud = *placed.cloud;
  const float* sh = &cloud.sh[index * cloud.shStride()];
  double basis[25];
  double slopes[25][3];
  basis[0] = static_cast<double>(kShC0);
  Vec3d direction = placed.eye;
  double length = 1.0;
  if (placed.sh_degree > 0) {
    if (scene.view.perspective) {
      const float* position = &cloud.positions[index * 3];
      direction = Vec3d(static_cast<double>(position[0]), static_cast<double>(position[1]),
                        static_cast<double>(position[2])) -
                  placed.eye;
    }
    length = direction.norm();
    direction /= length;
    harmonicBasis(placed.sh_degree, direction[0], direction[1], direction[2], basis);
    harmonicBasisGradient(placed.sh_degree, direction[0], direction[1], direction[2], slopes);
  }
  const size_t count = shCoefficientCount(placed.sh_degree);
  double by_basis[25] = {};
  Vec3d sums(0.5, 0.5, 0.5);
  for (size_t c = 0; c < 3; ++c) {
    const Eigen::Index channel = static_cast<Eigen::Index>(c);
    for (size_t k = 0; k < count; ++k) {
      sums[channel] += basis[k] * static_cast<double>(sh[k * 3 + c]);
    }
  }
  const Mat3d grading =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(placed.grade.matrix.data());
  const Vec3d graded = grading * sums + Eigen::Map<const Vec3d>(placed.grade.offset.data());
  Vec3d by_graded = Vec3d::Zero();
  for (int c = 0; c < 3; ++c) {
    if (!(graded[c] > 0.0 && graded[c] < 1e12)) continue;
    by_graded[c] = by_colour[c] * (placed.linearise ? srgbToLinearSlope(graded[c]) : 1.0);
  }
  const Vec3d by_sums = grading.transpose() * by_graded;
  for (size_t c = 0; c < 3; ++c) {
    const double by_sum = by_sums[static_cast<Eigen::Index>(c)];
    if (by_sum == 0.0) continue;
    for (size_t k = 0; k < count; ++k) by_sh[k * 3 + c] = storedGradient(by_sum * basis[k]);
    for (size_t k = 1; k < count; ++k) by_basis[k] += by_sum * static_cast<double>(sh[k * 3 + c]);
  }
  Vec3d by_direction = Vec3d::Zero();
  for (size_t k = 1; k < count; ++k) {
    by_direction += by_basis[k] * Vec3d(slopes[k][0], slopes[k][1], slopes[k][2]);
  }
  by_direction -= direction * direction.dot(by_direction);
  return by_direction / length;
}

}  // namespace stipple::testing
