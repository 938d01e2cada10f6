#pragma once

#include "math/vec.h"

namespace stipple {

/// Refuses matrices that cannot place an object: non-finite entries, entries above 1e15 (their
/// squares must not overflow), a last row other than 0 0 0 1, a linear part that is singular (its
/// determinant is below 1e-12 of what its columns allow). `what` names the matrix in the message.
void validateAffine(const Mat4d& matrix, const char* what);

inline Mat3d linearPart(const Mat4d& matrix) {
  return matrix.topLeftCorner<3, 3>();
}
inline Vec3d translationPart(const Mat4d& matrix) {
  return matrix.topRightCorner<3, 1>();
}

/// Inverse of a matrix that validateAffine accepts.
Mat3d inverse(const Mat3d& matrix);

/// Determinant; negative where the matrix mirrors.
double determinant(const Mat3d& matrix);

}  // namespace stipple
