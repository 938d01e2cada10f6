#pragma once

#include "math/camera.h"
#include "math/vec.h"

namespace stipple {

/// What a pixel sees, in the camera's frame: origin + place * direction. With an image plane, place
/// is view z; without, the direction is a unit vector and place the distance.
struct PixelRay {
  Vec3d origin;
  Vec3d direction;
};

/// Where on the lens rays start, metres to the right and downwards, and how far away all of its
/// points see the same.
struct LensPoint {
  double x = 0;
  double y = 0;
  double focus_distance = 1;
};

/// The rays of a camera's picture.
class CameraRays {
 public:
  /// In: a camera that validate() accepts. A point of the lens counts for cameras without an image
  /// plane only, whose lens stands across every ray, x horizontal; the others see the same from a
  /// camera that is moved and shifted (shot/sampled_render.h).
  explicit CameraRays(const Camera& camera, const LensPoint& lens = {});

  /// In: a place in the picture, pixels; centres of pixels are at +0.5. Returns false where the
  /// picture shows nothing: beyond a fisheye's field of view, beyond the poles of a panorama.
  bool through(double x, double y, PixelRay& ray) const;

 private:
  bool lookAt(double x, double y, Vec3d& direction) const;

  CameraModel model_;
  double fx_, fy_, cx_, cy_;
  double widest_;  ///< from the axis, radians
  LensPoint lens_;
  bool has_lens_;
};

}  // namespace stipple
