#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "math/cross_product.h"
#include "math/vec.h"
#include "splat/render/scene.h"

namespace stipple {

/// A splat as rays meet it, in view space.
struct RaySplat {
  Vec3d centre;   ///< metres
  Mat3d whiten;   ///< lengths along its axes in standard deviations, low-pass included
  double radius;  ///< metres: beyond it alpha is below the least that counts
  double opacity;
  double colour[3];
  bool is_holdout;
  uint32_t index;  ///< among all splats of the picture
};

/// Where a ray comes nearest to a splat.
struct RayResponse {
  double place;             ///< in units of the ray's direction
  double squared_distance;  ///< Mahalanobis
};

inline RayResponse respond(const RaySplat& splat, const Vec3d& origin, const Vec3d& direction) {
  const Vec3d from = splat.whiten * (origin - splat.centre);
  const Vec3d along = splat.whiten * direction;
  const double length = along.squaredNorm();
  return {-from.dot(along) / length, crossProduct(from, along).squaredNorm() / length};
}

/// View z, or the distance from a camera without an image plane.
inline double depthOf(const View<double>& view, const Vec3d& centre) {
  return view.is_wide ? centre.norm() : centre[2];
}

/// The planes through the borders of a perspective or parallel picture.
class ViewSides {
 public:
  explicit ViewSides(const View<double>& view);

  /// False only for spheres that no ray through the picture meets. View space, metres.
  bool touch(const Vec3d& centre, double radius) const;

 private:
  std::array<Vec3d, 4> inward_;  ///< unit normals
  std::array<double, 4> offsets_;
};

/// Splats that may show an alpha of least_alpha or more in the picture, in a panorama or fisheye
/// anywhere, centres between the near and the far plane; by rounded depth, then by place in the
/// scene.
std::vector<RaySplat> raySplats(const PlacedScene& scene, double least_alpha);

/// How many splats raySplats, or affineSplats where is_affine, finds at most. In: a scene seen in a
/// perspective or parallel view. Cost: a few operations a splat, nothing is projected.
uint64_t mostRaySplats(const PlacedScene& scene, double least_alpha, bool is_affine);

}  // namespace stipple
