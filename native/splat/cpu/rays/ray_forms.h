#pragma once

#include <cstdint>

#include "splat/cpu/rays/affine_splats.h"
#include "splat/render/ray_splats.h"

namespace stipple {

/// A splat as the pixels of a picture see it. With (dx, dy) the pixel minus (mean_x, mean_y), all
/// that a ray asks of a splat is a quotient of polynomials:
///   g = (l00 dx, l10 dx + l11 dy)
///   w = (t00 dx + t01 dy + t02, t11 dy + t12, t22)
///   squared distance = (2 / log2 e) |g|^2 / |w|^2
///   place of the largest response = (n + nx dx + ny dy) / |w|^2
/// In a perspective picture g is the cross product of the whitened centre and ray: linear in the
/// pixel and 0 at the centre, so nothing cancels near the axis of a needle; w is the whitened ray,
/// of length 1 through the centre. In affine and parallel pictures w is constant.
struct RayForm {
  double mean_x, mean_y;  ///< projected centre, pixels
  double l00, l10, l11;   ///< with sqrt(log2(e)/2)
  double t00, t01, t02, t11, t12, t22;
  double n, nx, ny;  ///< metres, metres per pixel
  double opacity, log2_opacity;
  double depth;    ///< view z of the centre, metres
  double nearest;  ///< no response that counts is nearer, metres
  double colour[3];
  bool is_holdout;
};

/// Pixels where alpha may reach the least that counts: an ellipse |L d| <= 1 about a place, as
/// forEachTileSpan wants it, or the whole picture.
struct RayReach {
  Footprint<double> ellipse;
  double half_x = 0, half_y = 0;  ///< pixels
  /// The splat reaches the plane of the camera: `centre` and `radius` tell where it may show.
  bool is_around = false;
  Vec3d centre;       ///< view space
  double radius = 0;  ///< metres
};

/// In: splat of raySplats.
RayForm rayForm(const View<double>& view, const RaySplat& splat);
RayReach rayReach(const View<double>& view, const RaySplat& splat, double least_alpha);

/// In: splat of affineSplats.
RayForm rayForm(const AffineSplat& splat);
RayReach rayReach(const AffineSplat& splat);

/// What a pixel's ray meets of a splat.
struct RayMeeting {
  double place;
  double alpha;  ///< held to nothing
};
RayMeeting meet(const RayForm& form, double x, double y);

}  // namespace stipple
