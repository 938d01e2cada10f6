#include "splat/cloud_transform.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/parallel.h"
#include "math/affine.h"
#include "math/quaternion.h"
#include "math/spherical_harmonics.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
constexpr double kTolerance = 1e-4;

struct Similarity {
  Mat3d rotation;
  double scale;
  Vec3d translation;
};

Similarity similarityOf(const Mat4d& matrix) {
  validateAffine(matrix, "matrix");
  Similarity similarity;
  const Mat3d linear = linearPart(matrix);
  const double det = determinant(linear);
  if (det < 0) {
    fail(ErrorCode::kInvalidArgument,
         "matrix mirrors (determinant " + std::to_string(det) +
             "); splats can be given a rotation, a translation and one positive scale");
  }
  similarity.scale = std::cbrt(det);
  similarity.rotation = linear / similarity.scale;
  similarity.translation = translationPart(matrix);
  const double error = (similarity.rotation * similarity.rotation.transpose() - Mat3d::Identity())
                           .cwiseAbs()
                           .maxCoeff();
  if (!(error <= kTolerance)) {
    fail(ErrorCode::kInvalidArgument, "matrix shears or scales unevenly (by " +
                                          std::to_string(error) +
                                          "); at most 0.0001 is allowed for splats");
  }
  return similarity;
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

}  // namespace

SplatCloud transformed(const SplatCloud& cloud, const Mat4d& matrix) {
  validate(cloud, "cloud");
  const Similarity similarity = similarityOf(matrix);
  const Vec4d turn = quaternionFromRotation(similarity.rotation);
  // The quaternion's own matrix is a rotation even where the given one is 1e-5 off.
  const HarmonicRotation harmonics(rotationFromQuaternion<double>(turn.data()));
  SplatCloud result = cloud;
  const size_t stride = cloud.shStride();
  parallelFor(cloud.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* p = &cloud.positions[i * 3];
      const Vec3d moved =
          similarity.scale *
              (similarity.rotation * Vec3d(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                           static_cast<double>(p[2]))) +
          similarity.translation;
      const Vec4d turned = product(turn, &cloud.rotations[i * 4]).normalized();
      for (size_t c = 0; c < 4; ++c) {
        result.rotations[i * 4 + c] = static_cast<float>(turned[static_cast<Eigen::Index>(c)]);
      }
      for (size_t axis = 0; axis < 3; ++axis) {
        result.positions[i * 3 + axis] =
            narrowed(moved[static_cast<Eigen::Index>(axis)], "position");
        result.scales[i * 3 + axis] =
            narrowed(static_cast<double>(cloud.scales[i * 3 + axis]) * similarity.scale, "scale");
      }
      harmonics.apply(cloud.sh_degree, &result.sh[i * stride]);
    }
  });
  return result;
}

}  // namespace stipple
