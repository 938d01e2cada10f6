#pragma once

#include "math/vec.h"

namespace stipple {

/// The ellipsoid that a matrix makes of the unit sphere: A = axes * diag(lengths) * turn^T.
struct PrincipalAxes {
  Mat3d axes;     ///< columns: unit, orthogonal, right-handed
  Vec3d lengths;  ///< half-axes, >= 0, in the order of A's columns
  Mat3d turn;     ///< orthogonal; mirrors where A does
};

/// Singular values of a 3x3 matrix, in the order of its columns: column k of the result is the one
/// that A's column k turns into by the smallest rotations, so axes that are orthogonal already keep
/// their places. Small lengths are as exact, relatively, as large ones. Where lengths are 0, the
/// axes are completed to a right-handed frame.
PrincipalAxes principalAxes(const Mat3d& matrix);

/// The orthogonal factor of the polar decomposition of an invertible matrix: the rotation (or
/// rotation and mirror) nearest to it. Its determinant has the sign of the matrix's.
Mat3d nearestOrthogonal(const Mat3d& matrix);

}  // namespace stipple
