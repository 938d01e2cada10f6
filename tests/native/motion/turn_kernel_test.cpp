#include "motion/turn_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "math/principal_axes.h"
#include "math/quaternion.h"
#include "math/spherical_harmonics.h"

namespace stipple {
namespace {

double drawn(uint64_t stream, uint64_t index, double from, double to) {
  return from + (to - from) *
                    static_cast<double>(unitFloat(keyedBits(stream, RandomUse::kThinning, index)));
}

Mat3d turnOf(uint64_t stream, size_t row) {
  double q[4];
  for (size_t i = 0; i < 4; ++i) q[i] = drawn(stream, 4 * row + i, -1, 1);
  return rotationFromQuaternion<double>(q);
}

/// Turns by anything, and stretches of up to `most` and one over it along any axes.
std::vector<float> deformations(size_t rows, double most) {
  std::vector<float> columns(9 * rows);
  for (size_t row = 0; row < rows; ++row) {
    Vec3d stretch;
    for (size_t axis = 0; axis < 3; ++axis) {
      stretch[static_cast<int>(axis)] = std::pow(most, drawn(3, 3 * row + axis, -1, 1));
    }
    if (row % 5 == 1) stretch = {most, 1 / most, 1 / most};
    if (row % 5 == 2) stretch = {most, most, 1 / most};
    if (row % 5 == 3) stretch.setOnes();
    const Mat3d matrix = turnOf(1, row) * stretch.asDiagonal() * turnOf(2, row);
    for (size_t k = 0; k < 9; ++k) {
      columns[k * rows + row] = static_cast<float>(
          matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)));
    }
  }
  return columns;
}

std::vector<float> harmonics(size_t rows, int degree) {
  std::vector<float> sh(rows * static_cast<size_t>((degree + 1) * (degree + 1)) * 3);
  for (size_t i = 0; i < sh.size(); ++i) sh[i] = static_cast<float>(drawn(4, i, -1, 1));
  return sh;
}

/// Largest difference from the plain kernel, which works in double.
double worst(const TurnKernel& kernel, size_t rows, int degree, double most) {
  const std::vector<float> columns = deformations(rows, most);
  std::vector<float> made = harmonics(rows, degree), wanted = made;
  kernel.turn({columns.data(), rows, made.data(), degree}, rows);
  scalarTurnKernel().turn({columns.data(), rows, wanted.data(), degree}, rows);
  double largest = 0;
  for (size_t i = 0; i < made.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(made[i] - wanted[i])));
  }
  return largest;
}

TEST(TurnKernel, AgreesWithDoubleOnEveryInstructionSet) {
  for (const TurnKernel& kernel : turnKernels()) {
    for (const int degree : {1, 2, 3, 4}) {
      for (const size_t rows : {size_t{1}, size_t{5}, size_t{16}, size_t{1003}}) {
        const std::string name = std::string(kernel.target) + " of degree " +
                                 std::to_string(degree) + ", " + std::to_string(rows);
        for (const double most : {1.0, 2.0, 10.0}) {
          // Coefficients of up to 1, two sums of up to nine products, directions off by a few steps
          // of float32: twice what is seen.
          EXPECT_LT(worst(kernel, rows, degree, most), 6e-6) << name << ", stretched by " << most;
        }
      }
    }
  }
}

TEST(TurnKernel, TurnsTheFunctionAndLeavesTheMeanColour) {
  constexpr size_t kRows = 40;
  const std::vector<float> columns = deformations(kRows, 3);
  for (const TurnKernel& kernel : turnKernels()) {
    const std::vector<float> before = harmonics(kRows, 3);
    std::vector<float> after = before;
    kernel.turn({columns.data(), kRows, after.data(), 3}, kRows);
    for (size_t row = 0; row < kRows; ++row) {
      Mat3d matrix;
      for (size_t k = 0; k < 9; ++k) {
        matrix(static_cast<Eigen::Index>(k / 3), static_cast<Eigen::Index>(k % 3)) =
            static_cast<double>(columns[k * kRows + row]);
      }
      const Mat3d rotation = nearestOrthogonal(matrix);
      const Vec3d there = Vec3d(drawn(5, row, -1, 1), drawn(6, row, -1, 1), 0.3).normalized();
      const Vec3d here = rotation * there;
      double basis_there[25], basis_here[25];
      harmonicBasis(3, there.x(), there.y(), there.z(), basis_there);
      harmonicBasis(3, here.x(), here.y(), here.z(), basis_here);
      for (size_t c = 0; c < 3; ++c) {
        double was = 0, is = 0;
        for (size_t k = 0; k < 16; ++k) {
          was += basis_there[k] * static_cast<double>(before[row * 48 + 3 * k + c]);
          is += basis_here[k] * static_cast<double>(after[row * 48 + 3 * k + c]);
        }
        ASSERT_NEAR(is, was, 2e-5) << kernel.target << " row " << row;
        ASSERT_EQ(after[row * 48 + c], before[row * 48 + c]);
      }
    }
  }
}

TEST(TurnKernel, GivesARowTheSameBitsWhereverItsRangeBegins) {
  // Ranges of a parallel loop begin at multiples of the longest vector.
  constexpr size_t kRows = 150, kFirst = 64;
  const std::vector<float> columns = deformations(kRows, 10);
  for (const TurnKernel& kernel : turnKernels()) {
    std::vector<float> whole = harmonics(kRows, 2), parts = whole;
    kernel.turn({columns.data(), kRows, whole.data(), 2}, kRows);
    kernel.turn({columns.data(), kRows, parts.data(), 2}, kFirst);
    kernel.turn({columns.data() + kFirst, kRows, parts.data() + kFirst * 27, 2}, kRows - kFirst);
    EXPECT_EQ(whole, parts) << kernel.target;
  }
}

}  // namespace
}  // namespace stipple
