#pragma once

#include <optional>

#include "math/camera.h"
#include "math/vec.h"

namespace stipple {

/// Where a place of the world is in a picture.
struct PlaceInPicture {
  double x = 0;  ///< pixels, 0 at the left edge
  double y = 0;
  size_t pixel = 0;      ///< row * width + column
  Vec3d in_camera = {};  ///< metres
};

/// Nothing for places that are not between the camera's planes, and for those outside the picture.
std::optional<PlaceInPicture> placeInPicture(const Camera& camera, const Vec3d& place);

/// Lower Cholesky factor L of a splat's covariance in the picture, px^2: [l00 0; l10 l11], L L^T.
struct FootprintFactor {
  double l00 = 0, l10 = 0, l11 = 0;
};

/// In: axes: the splat's axes times its deviations (scaledAxes()), a place that is in the picture.
/// The covariance is that of the affine approximation around the centre, plus 0.3 px^2.
/// Source: Zwicker, Pfister, van Baar, Gross, EWA Volume Splatting, Visualization 2001.
FootprintFactor footprintFactor(const Camera& camera, const PlaceInPicture& place,
                                const Mat3d& axes);

}  // namespace stipple
