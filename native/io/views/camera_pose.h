#pragma once

#include "math/camera.h"
#include "math/vec.h"

namespace stipple {

/// How far a stored rotation may be from orthonormal: three decimal digits in the file.
constexpr double kRotationTolerance = 5e-3;

/// Takes from a rotation of a file what rounding and a scaled parent have done to it. In, out:
/// rotation, which becomes the nearest one, with columns of length 1. Out: error, by which it
/// differed from orthonormal. Returns: false where that is more than kRotationTolerance, or where
/// it is a mirror image; nothing is said of the rotation then.
bool takeNearestRotation(Mat3d& rotation, double& error);

/// Puts a camera where it stands. In: axes, its right, down and forward as columns, in the world;
/// centre, metres.
void placeCamera(const Mat3d& axes, const Vec3d& centre, Camera& camera);

}  // namespace stipple
