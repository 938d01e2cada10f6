#pragma once

#include <cstdint>

#include "math/vec.h"

namespace stipple {

enum class CameraModel : uint32_t {
  kPerspective = 0,
  kOrthographic = 1,
  kEquirectangular = 2,     ///< longitude to the right, latitude upwards
  kFisheyeEquidistant = 3,  ///< the radius is the angle to the axis
  kFisheyeEquisolid = 4,    ///< the radius is 2 sin(angle / 2)
};

/// OpenCV frame: x right, y down, z forward; pixel (i, j) has its centre at (i + 0.5, j + 0.5), the
/// first row is the top of the picture. What a pixel sees: math/camera_rays.h.
struct Camera {
  CameraModel model = CameraModel::kPerspective;
  uint32_t width = 0;   ///< pixels
  uint32_t height = 0;  ///< pixels
  /// Perspective: focal length in pixels; orthographic: pixels per metre; others: pixels per
  /// radian, of the equisolid fisheye at its axis.
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;  ///< pixel of the optical axis; outside the picture for strong lens shift
  double cy = 0.0;
  Mat4d world_to_camera = Mat4d::Identity();  ///< rigid, metres
  /// Metres, as depths are; nearer centres are not drawn.
  double near_plane = 0.01;
  double far_plane = 1e10;
  /// Fisheyes: full angle, radians, up to 2 pi; pixels beyond it see nothing. 0: 2 pi. Others: 0.
  double field_of_view = 0.0;
};

/// False for panoramas and fisheyes: they see directions, nothing projects affinely into their
/// pictures, and depths are distances from the camera instead of view z.
inline bool hasImagePlane(const Camera& camera) {
  return camera.model == CameraModel::kPerspective || camera.model == CameraModel::kOrthographic;
}

/// Refuses panoramas and fisheyes. In: what wants the plane, as a sentence begins with it.
void requireImagePlane(const Camera& camera, const char* who);

/// Refuses cameras that cannot make a picture: sizes of 0 or above 65,536, a focal length that is
/// not positive or above 1e9, an axis beyond 1e12 pixels, numbers that are not finite, a matrix
/// that is not a rotation and a translation up to 1e24 m, near >= far, a near plane below 1e-9 m
/// unless orthographic, a field of view above 360 degrees, or 360 by 180 of an equirectangular
/// picture.
void validate(const Camera& camera);

/// The camera of the same picture with `factor` times the pixels along each side, and with a factor
/// fewer of them; what is left of a block of pixels is cut off. In: factor >= 1.
Camera enlarged(Camera camera, uint32_t factor);
Camera reduced(Camera camera, uint32_t factor);

/// Centre of the camera in the world (perspective), metres.
Vec3d cameraCentre(const Camera& camera);

}  // namespace stipple
