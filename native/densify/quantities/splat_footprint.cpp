// Based on: Zwicker, Pfister, van Baar, Gross, EWA Volume Splatting, Visualization 2001. Differs:
// the covariance is never formed; the rows of [J W A | low-pass] are made orthogonal, which gives
// its Cholesky factor without a difference that could come out negative for needles.

#include "densify/quantities/splat_footprint.h"

#include <algorithm>
#include <cmath>

namespace stipple {

std::optional<PlaceInPicture> placeInPicture(const Camera& camera, const Vec3d& place) {
  PlaceInPicture found;
  found.in_camera = camera.world_to_camera.topLeftCorner<3, 3>() * place +
                    camera.world_to_camera.topRightCorner<3, 1>();
  const double depth = found.in_camera.z();
  if (!(depth > camera.near_plane && depth < camera.far_plane)) return {};
  const double scale = camera.model == CameraModel::kPerspective ? 1 / depth : 1;
  found.x = camera.fx * found.in_camera.x() * scale + camera.cx;
  found.y = camera.fy * found.in_camera.y() * scale + camera.cy;
  if (!(found.x >= 0 && found.x < camera.width && found.y >= 0 && found.y < camera.height)) {
    return {};
  }
  found.pixel = static_cast<size_t>(found.y) * camera.width + static_cast<size_t>(found.x);
  return found;
}

FootprintFactor footprintFactor(const Camera& camera, const PlaceInPicture& place,
                                const Mat3d& axes) {
  constexpr double kLowPass = 0.3;  // px^2
  const Mat3d seen = camera.world_to_camera.topLeftCorner<3, 3>() * axes;
  Vec3d rows[2];  // of J W A, pixels
  const double focal[2] = {camera.fx, camera.fy};
  for (int k = 0; k < 2; ++k) {
    if (camera.model == CameraModel::kPerspective) {
      // Inside the picture x/z needs no other limits than the picture's.
      const double depth = place.in_camera.z();
      rows[k] =
          focal[k] / depth * (seen.row(k) - place.in_camera[k] / depth * seen.row(2)).transpose();
    } else {
      rows[k] = focal[k] * seen.row(k).transpose();
    }
  }
  FootprintFactor factor;
  factor.l00 = std::sqrt(rows[0].squaredNorm() + kLowPass);
  const double along = rows[0].dot(rows[1]) / factor.l00;
  factor.l10 = along;
  // What of the second row is across the first, of [row | low-pass in two further places].
  const double share = along / factor.l00;
  const double across = (rows[1] - share * rows[0]).squaredNorm() + kLowPass * (1 + share * share);
  factor.l11 = std::sqrt(across);
  return factor;
}

}  // namespace stipple
