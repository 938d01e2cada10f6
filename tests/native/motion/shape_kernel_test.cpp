#include "motion/shape_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "math/quaternion.h"
#include "math/vec.h"

namespace stipple {
namespace {

float drawn(uint64_t stream, uint64_t index, float from, float to) {
  return from + (to - from) * unitFloat(keyedBits(stream, RandomUse::kThinning, index));
}

struct Splats {
  std::vector<float> deformations, rotations, scales, out_rotations, out_scales;
  size_t count;

  explicit Splats(size_t rows)
      : deformations(9 * rows), out_rotations(4 * rows), out_scales(3 * rows), count(rows) {}
  ShapeColumns columns() {
    return {deformations.data(), count, rotations.data(), scales.data(), out_rotations.data(),
            out_scales.data()};
  }
  Mat3d deformation(size_t row) const {
    Mat3d matrix;
    for (size_t k = 0; k < 9; ++k) {
      matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)) =
          static_cast<double>(deformations[k * count + row]);
    }
    return matrix;
  }
};

/// The covariance of a rotation and standard deviations.
Mat3d covarianceOf(const float* rotation, const float* scales) {
  const Mat3d axes = rotationFromQuaternion<double>(rotation);
  const Vec3d lengths(scales[0], scales[1], scales[2]);
  return axes * lengths.cwiseAbs2().asDiagonal() * axes.transpose();
}

Splats someSplats(size_t rows) {
  Splats splats(rows);
  for (size_t row = 0; row < rows; ++row) {
    // Turns, and stretches from 0.1 to 10 along other axes.
    float a[4], b[4];
    for (size_t i = 0; i < 4; ++i) {
      a[i] = drawn(1, 4 * row + i, -1, 1);
      b[i] = drawn(2, 4 * row + i, -1, 1);
    }
    const Vec3d stretch(std::pow(10, drawn(3, row, -1, 1)), std::pow(10, drawn(4, row, -1, 1)), 1);
    const Mat3d matrix = rotationFromQuaternion<double>(a) * stretch.asDiagonal() *
                         rotationFromQuaternion<double>(b);
    for (size_t k = 0; k < 9; ++k) {
      splats.deformations[k * rows + row] = static_cast<float>(
          matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)));
    }
    Vec4d rotation;
    for (int i = 0; i < 4; ++i) rotation[i] = drawn(5, 4 * row + static_cast<size_t>(i), -1, 1);
    rotation.normalize();
    for (int i = 0; i < 4; ++i) splats.rotations.push_back(static_cast<float>(rotation[i]));
    for (size_t i = 0; i < 3; ++i) {
      const float scale = std::pow(10.0f, drawn(6, 3 * row + i, -4, 0));
      // Some flat ones, some that are points, some all alike.
      splats.scales.push_back(row % 7 == 1 && i == 2 ? 0.0f : row % 7 == 2 ? 0.01f : scale);
    }
    if (row % 31 == 5) std::fill_n(splats.scales.end() - 3, 3, 0.0f);
  }
  return splats;
}

TEST(ShapeKernel, GivesTheDeformedCovarianceOnEveryInstructionSet) {
  for (const size_t rows : {size_t{1}, size_t{5}, size_t{16}, size_t{700}}) {
    for (const ShapeKernel& kernel : shapeKernels()) {
      Splats splats = someSplats(rows);
      kernel.deform(splats.columns(), rows);
      for (size_t row = 0; row < rows; ++row) {
        const Mat3d linear = splats.deformation(row);
        const Mat3d wanted = linear *
                             covarianceOf(&splats.rotations[4 * row], &splats.scales[3 * row]) *
                             linear.transpose();
        const Mat3d made =
            covarianceOf(&splats.out_rotations[4 * row], &splats.out_scales[3 * row]);
        // Axes are off by a few steps of float32, and squares of lengths twice that.
        EXPECT_LE((made - wanted).norm(), 4e-6 * wanted.norm() + 1e-30)
            << kernel.target << ' ' << row;
        double length = 0;
        for (size_t i = 0; i < 4; ++i) {
          length += static_cast<double>(splats.out_rotations[4 * row + i]) *
                    static_cast<double>(splats.out_rotations[4 * row + i]);
        }
        EXPECT_NEAR(length, 1, 1e-6);
        for (size_t i = 0; i < 3; ++i) {
          EXPECT_EQ(splats.out_scales[3 * row + i] == 0, splats.scales[3 * row + i] == 0)
              << kernel.target << ' ' << row;
        }
      }
    }
  }
}

TEST(ShapeKernel, RotationsAndOneScaleKeepAxesAndTheirOrder) {
  constexpr size_t kRows = 40;
  for (const ShapeKernel& kernel : shapeKernels()) {
    Splats splats = someSplats(kRows);
    const float turn[4] = {0.5f, -0.5f, 0.1f, 0.7f};
    const Mat3d matrix = 2.5 * rotationFromQuaternion<double>(turn);
    for (size_t row = 0; row < kRows; ++row) {
      for (size_t k = 0; k < 9; ++k) {
        splats.deformations[k * kRows + row] = static_cast<float>(
            matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)));
      }
    }
    kernel.deform(splats.columns(), kRows);
    for (size_t row = 0; row < kRows; ++row) {
      // A ball has no axes of its own.
      if (splats.scales[3 * row] == splats.scales[3 * row + 1]) continue;
      const Mat3d before = rotationFromQuaternion<double>(&splats.rotations[4 * row]);
      const Mat3d after = rotationFromQuaternion<double>(&splats.out_rotations[4 * row]);
      EXPECT_LE((after - matrix / 2.5 * before).norm(), 2e-6) << kernel.target;
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(splats.out_scales[3 * row + i], 2.5f * splats.scales[3 * row + i],
                    1e-6f * splats.scales[3 * row + i]);
      }
    }
  }
}

}  // namespace
}  // namespace stipple
