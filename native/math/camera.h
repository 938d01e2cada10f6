#pragma once

#include <cstdint>

#include "math/vec.h"

namespace stipple {

enum class CameraModel : uint32_t { kPerspective = 0, kOrthographic = 1 };

/// A pinhole or orthographic camera. OpenCV frame: x right, y down, z forward; pixel (i, j) has its
/// centre at (i + 0.5, j + 0.5), the first row is the top of the picture.
struct Camera {
  CameraModel model = CameraModel::kPerspective;
  uint32_t width = 0;   ///< pixels
  uint32_t height = 0;  ///< pixels
  double fx = 0.0;      ///< perspective: focal length in pixels; orthographic: pixels per metre
  double fy = 0.0;
  double cx = 0.0;  ///< pixel of the optical axis; outside the picture for strong lens shift
  double cy = 0.0;
  Mat4d world_to_camera = Mat4d::Identity();  ///< rigid, metres
  double near_plane = 0.01;                   ///< metres along z; nearer centres are not drawn
  double far_plane = 1e10;                    ///< metres along z
};

/// Refuses cameras that cannot make a picture: sizes of 0 or above 65,536, a focal length that is
/// not positive or above 1e9, numbers that are not finite, a matrix that is not a rotation and a
/// translation, near >= far, a perspective near plane below 1e-9 m.
void validate(const Camera& camera);

/// Centre of the camera in the world (perspective), metres.
Vec3d cameraCentre(const Camera& camera);

}  // namespace stipple
