#include "math/affine.h"

#include <Eigen/LU>
#include <cmath>
#include <string>

#include "base/error.h"

namespace stipple {

void validateAffine(const Mat4d& matrix, const char* what) {
  for (Eigen::Index i = 0; i < 16; ++i) {
    const double value = matrix.data()[i];
    // isfinite first: comparing a NaN is an invalid operation where those are trapped.
    if (!std::isfinite(value) || std::abs(value) > 1e15) {
      fail(ErrorCode::kInvalidArgument, std::string(what) + " holds " + std::to_string(value) +
                                            "; finite numbers up to 1e15 are allowed");
    }
  }
  const Eigen::Matrix<double, 1, 4> last(0, 0, 0, 1);
  if (matrix.row(3) != last) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " must end with the row 0 0 0 1");
  }
  const Mat3d linear = linearPart(matrix);
  // Hadamard: |det| is at most the product of the column lengths.
  const double allowed = linear.col(0).norm() * linear.col(1).norm() * linear.col(2).norm();
  if (!(allowed > 0) || std::abs(linear.determinant()) < 1e-12 * allowed) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " is singular (determinant " +
                                          std::to_string(linear.determinant()) +
                                          "); it must be invertible");
  }
}

Mat3d inverse(const Mat3d& matrix) {
  return matrix.inverse();
}

double determinant(const Mat3d& matrix) {
  return matrix.determinant();
}

}  // namespace stipple
