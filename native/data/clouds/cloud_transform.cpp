#include "data/clouds/cloud_transform.h"

#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/covariance.h"
#include "math/principal_axes.h"
#include "math/quaternion.h"
#include "math/spherical_harmonics.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
/// A matrix this near to rotation x scale is taken for one: what float32 leaves of its entries.
constexpr double kRounding = 5e-7;

/// A matrix, taken apart.
struct Affine {
  Mat3d linear;
  Vec3d translation;
  Vec4d turn;       ///< w,x,y,z of the rotation in the polar decomposition, mirror left out
  double scale;     ///< its uniform part: cube root of |determinant|
  bool mirrors;     ///< the orthogonal part is minus the rotation
  bool keeps_axes;  ///< rotation, mirror and one scale only
};

Affine affineOf(const Mat4d& matrix) {
  validateAffine(matrix, "matrix");
  Affine affine;
  affine.linear = linearPart(matrix);
  affine.translation = translationPart(matrix);
  const double det = determinant(affine.linear);
  affine.mirrors = det < 0;
  affine.scale = std::cbrt(std::abs(det));
  const Mat3d unit = affine.linear / (affine.mirrors ? -affine.scale : affine.scale);
  const double error = (unit * unit.transpose() - Mat3d::Identity()).cwiseAbs().maxCoeff();
  affine.keeps_axes = error <= kRounding;
  affine.turn = quaternionFromRotation(affine.keeps_axes ? unit : nearestOrthogonal(unit));
  return affine;
}

Vec4d product(const Vec4d& a, const float* b) {
  const double w = static_cast<double>(b[0]), x = static_cast<double>(b[1]),
               y = static_cast<double>(b[2]), z = static_cast<double>(b[3]);
  return {a[0] * w - a[1] * x - a[2] * y - a[3] * z, a[0] * x + a[1] * w + a[2] * z - a[3] * y,
          a[0] * y - a[1] * z + a[2] * w + a[3] * x, a[0] * z + a[1] * y - a[2] * x + a[3] * w};
}

float narrowed(double value, const char* what) {
  if (!(std::abs(value) <= 3.4e38)) {
    fail(ErrorCode::kInvalidArgument, std::string("matrix makes a ") + what + " of " +
                                          std::to_string(value) +
                                          " m; at most 3.4e38 can be stored");
  }
  return static_cast<float>(value);
}

Vec3d vectorAt(const float* values) {
  return {static_cast<double>(values[0]), static_cast<double>(values[1]),
          static_cast<double>(values[2])};
}

struct Shape {
  Vec4d rotation;  ///< w,x,y,z, unit
  Vec3d scales;
};

Shape movedShape(const Affine& affine, const float* rotation, const float* scales) {
  // A covariance does not see a point reflection, so the mirrored case is the rotation's.
  if (affine.keeps_axes) {
    return {product(affine.turn, rotation).normalized(), affine.scale * vectorAt(scales)};
  }
  const PrincipalAxes shape = principalAxes(affine.linear * scaledAxes<double>(rotation, scales));
  if (!(shape.lengths.maxCoeff() > 0))
    return {product(affine.turn, rotation).normalized(), shape.lengths};
  return {quaternionFromRotation(shape.axes), shape.lengths};
}

}  // namespace

SplatCloud transformed(const SplatCloud& cloud, const Mat4d& matrix) {
  validate(cloud, "cloud");
  const Affine affine = affineOf(matrix);
  // The quaternion's own matrix is a rotation even where the given one is 1e-7 off.
  const Mat3d rotation = rotationFromQuaternion<double>(affine.turn.data());
  const HarmonicRotation harmonics(affine.mirrors ? Mat3d(-rotation) : rotation);
  SplatCloud result = cloud;
  const size_t stride = cloud.shStride();
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3d moved = affine.linear * vectorAt(&cloud.positions[i * 3]) + affine.translation;
      const Shape shape = movedShape(affine, &cloud.rotations[i * 4], &cloud.scales[i * 3]);
      for (size_t c = 0; c < 4; ++c) {
        result.rotations[i * 4 + c] =
            static_cast<float>(shape.rotation[static_cast<Eigen::Index>(c)]);
      }
      for (size_t k = 0; k < 3; ++k) {
        const Eigen::Index axis = static_cast<Eigen::Index>(k);
        result.positions[i * 3 + k] = narrowed(moved[axis], "position");
        result.scales[i * 3 + k] = narrowed(shape.scales[axis], "scale");
      }
      harmonics.apply(cloud.sh_degree, &result.sh[i * stride]);
    }
  });
  return result;
}

}  // namespace stipple
