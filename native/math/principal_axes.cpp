#include "math/principal_axes.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

// Based on: Hestenes, Inversion of Matrices by Biorthogonalization and Related Results, J. SIAM
// 1958 (one-sided Jacobi); Demmel and Veselic, Jacobi's Method is More Accurate than QR, SIAM J.
// Matrix Anal. Appl. 1992 (the relative accuracy of small singular values).

namespace stipple {

namespace {

constexpr int kMaxSweeps = 40;
constexpr double kOrthogonal = 1e-15;  ///< cosine between two columns that counts as zero

/// Turns columns p and q of b (and of v) so that they are orthogonal. False: they were.
bool orthogonalise(Mat3d& b, Mat3d& v, int p, int q) {
  const double pp = b.col(p).squaredNorm();
  const double qq = b.col(q).squaredNorm();
  const double pq = b.col(p).dot(b.col(q));
  if (!(std::abs(pq) > kOrthogonal * std::sqrt(pp) * std::sqrt(qq))) return false;
  // The smaller of the two angles, at most 45 degrees: columns keep their places.
  const double ratio = (qq - pp) / (2.0 * pq);
  // Beyond 1e8 the root is the ratio to the last bit, and its square might not be a number.
  const double size = std::abs(ratio);
  const double root = size < 1e8 ? std::sqrt(1.0 + size * size) : size;
  const double t = std::copysign(1.0, ratio) / (size + root);
  const double c = 1.0 / std::sqrt(1.0 + t * t);
  const double s = c * t;
  for (Mat3d* m : {&b, &v}) {
    const Vec3d old_p = m->col(p);
    const Vec3d old_q = m->col(q);
    m->col(p) = c * old_p - s * old_q;
    m->col(q) = s * old_p + c * old_q;
  }
  return true;
}

/// A unit vector orthogonal to a unit vector.
Vec3d orthogonalTo(const Vec3d& unit) {
  Eigen::Index smallest = 0;
  unit.cwiseAbs().minCoeff(&smallest);
  return unit.cross(Vec3d::Unit(smallest)).normalized();
}

/// Unit directions of nearly orthogonal columns, from the longest down: what rounding left of a
/// column whose length is nothing beside the others' is replaced.
Mat3d frameOf(const Mat3d& b, const Vec3d& lengths) {
  std::array<int, 3> order = {0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](int x, int y) { return lengths[x] > lengths[y]; });
  const auto [first, second, third] = order;
  Mat3d axes;
  const Vec3d longest = lengths[first] > 0 ? Vec3d(b.col(first) / lengths[first]) : Vec3d::UnitX();
  Vec3d middle = lengths[second] > 0 ? Vec3d(b.col(second) / lengths[second]) : Vec3d::Zero();
  middle -= longest * longest.dot(middle);
  if (middle.squaredNorm() < 0.25) middle = orthogonalTo(longest);
  const Vec3d last = longest.cross(middle).normalized();
  axes.col(first) = longest;
  axes.col(second) = middle.normalized();
  axes.col(third) = last.dot(b.col(third)) < 0 ? Vec3d(-last) : last;
  return axes;
}

}  // namespace

PrincipalAxes principalAxes(const Mat3d& matrix) {
  PrincipalAxes result;
  // Squares of the columns stay in range.
  const double largest = matrix.cwiseAbs().maxCoeff();
  Mat3d b = largest > 0 ? Mat3d(matrix / largest) : matrix;
  result.turn = Mat3d::Identity();
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool turned = orthogonalise(b, result.turn, 0, 1);
    turned |= orthogonalise(b, result.turn, 0, 2);
    turned |= orthogonalise(b, result.turn, 1, 2);
    if (!turned) break;
  }
  const Vec3d lengths(b.col(0).norm(), b.col(1).norm(), b.col(2).norm());
  result.lengths = lengths * largest;
  result.axes = frameOf(b, lengths);
  if (result.axes.determinant() < 0) {
    result.axes.col(2) = -result.axes.col(2);
    result.turn.col(2) = -result.turn.col(2);
  }
  return result;
}

Mat3d nearestOrthogonal(const Mat3d& matrix) {
  const PrincipalAxes axes = principalAxes(matrix);
  return axes.axes * axes.turn.transpose();
}

}  // namespace stipple
