#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "splat/render/render.h"

// What splats and a camera say about the effects that a picture of them needs.

namespace stipple {

struct EffectsSurvey {
  uint64_t splat_count = 0;
  uint64_t seen_count = 0;  ///< of those that were looked at, in the picture
  uint64_t looked_count = 0;
  int sh_degree = 0;  ///< the largest of the clouds
  /// [degree] root of the mean square, over all directions, of what the harmonics of that degree
  /// add to a colour; mean of what is seen, each splat weighing as much as it covers. 0: 0.
  std::array<double, kMaxShDegree + 1> view_change = {};
  /// Pixels by which the affine projection moves what shows of a splat at most, exceeded by
  /// kUnusualShare of what is seen; 0 for models that are not perspective. No more than the
  /// picture's diagonal.
  double affine_error_px = 0;
  /// What it would be straight ahead: for the field of view at which it becomes too much.
  double error_ahead_px = 0;
  /// Radians: the angle across the widest diagonal of the picture; 0 for orthographic cameras.
  double field_of_view = 0;
  /// Area that splats cover with the classic low-pass (+0.3 px^2) over the area that they cover
  /// without, weighed by opacity; 1 for clouds that were made for the compensating one.
  double widening = 1;
  uint64_t object_count = 0;  ///< instances with splats
  /// Instances whose centres' view depths lie between those of another: only these mix.
  uint64_t mixed_count = 0;
};

constexpr double kUnusualShare = 0.01;

/// Looks at up to 2^17 splats, evenly over all of them, and at every depth where there are several
/// instances. Same result for any number of threads. Cost: O(2^17), and 12 bytes per splat read
/// with several instances. Errors: those of renderTiled.
EffectsSurvey surveyEffects(std::span<const SplatInstance> instances, const Camera& camera);

/// How far the affine projection moves what shows of a splat, pixels, at most: infinite where the
/// splat reaches the camera's plane.
/// With centre x, depth z and covariance C in view space, a point x + d projects by the affine
/// map wrongly by e = f b (r b - a) / (1 + b), r = (x, y)/z, a = (dx, dy)/z, b = dz/z. Over the
/// ellipsoid d^T C^-1 d <= k^2 the product of two linear forms u.d v.d is at most
/// k^2 (|u C v| + sqrt(u C u v C v)) / 2; with J the affine map that is
/// |e| <= k^2 (|J C ez| + sqrt(Czz L)) / (2 z (1 - B)), L the larger eigenvalue of J C J^T and
/// B = k sqrt(Czz)/z. For a round splat of radius R px at the angle t from the axis:
/// R^2 (tan t + sec t) / (2 f (1 - R/f)).
/// In: centre and axes (columns, metres) in view space; rim: k, standard deviations.
double affineErrorBound(const Camera& camera, const Vec3d& centre, const Mat3d& axes, double rim);

/// Full field of view, radians, up to which splats that miss by so much straight ahead stay within
/// an error: away from the axis the bound grows as tan t + sec t = tan(pi/4 + t/2).
double affineFieldOfView(double error_ahead_px, double error_px);

}  // namespace stipple
