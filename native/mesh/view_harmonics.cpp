#include "mesh/view_harmonics.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "math/colour.h"
#include "math/spherical_harmonics.h"
#include "math/vec.h"

namespace stipple {

namespace {

/// Normals are told apart by the cells of an octahedron's sides, 2.4 degrees wide at most: weights
/// change little over that.
constexpr size_t kCellsAlongSide = 64;
/// A direction counts fully from a cosine to the normal of 0.2 on, and a fifth where it comes from
/// behind: renderers bend such directions until they graze the surface, so they tell something of
/// what is seen at a slant, and nothing else holds the fit there.
constexpr double kBehindCosine = -0.05;
constexpr double kFullCosine = 0.2;
constexpr double kBehindWeight = 0.2;
/// Weight of keeping coefficients of degree l small, times l^4 (the square of the curvature), over
/// that of the colours. These numbers were set by PSNR of baked glossy meshes:
/// docs/results/surfaces.md.
constexpr double kHolding = 0.03;

/// Based on: Meyer et al., On Floating-Point Normal Vectors, EGSR 2010 (octahedral coordinates).
size_t cellOf(const float* n) {
  const double size = std::abs(static_cast<double>(n[0])) + std::abs(static_cast<double>(n[1])) +
                      std::abs(static_cast<double>(n[2]));
  if (!(size > 0)) return 0;
  double x = static_cast<double>(n[0]) / size, y = static_cast<double>(n[1]) / size;
  if (n[2] < 0) {
    const double folded = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
    x = folded;
  }
  const auto along = [](double v) {
    return static_cast<size_t>(
        std::clamp((v + 1) * 0.5 * kCellsAlongSide, 0.0, kCellsAlongSide - 1.0));
  };
  return along(y) * kCellsAlongSide + along(x);
}

Vec3d normalOf(size_t cell) {
  const auto along = [](size_t i) {
    return (static_cast<double>(i) + 0.5) / kCellsAlongSide * 2 - 1;
  };
  double x = along(cell % kCellsAlongSide), y = along(cell / kCellsAlongSide);
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z < 0) {
    const double unfolded = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
    x = unfolded;
  }
  return Vec3d(x, y, z).normalized();
}

double weightOf(double cosine) {
  const double t = std::clamp((cosine - kBehindCosine) / (kFullCosine - kBehindCosine), 0.0, 1.0);
  return std::max(kBehindWeight, t * t * (3 - 2 * t));
}

}  // namespace

ViewHarmonics::ViewHarmonics(std::span<const float> directions, int degree)
    : direction_count_(directions.size() / 3),
      coefficient_count_(static_cast<size_t>(degree + 1) * static_cast<size_t>(degree + 1)) {
  const auto columns = static_cast<Eigen::Index>(direction_count_ + 1);
  const auto rows = static_cast<Eigen::Index>(coefficient_count_);
  using Basis = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;
  const auto basisOf = [&](const Vec3d& d, Basis& basis, Eigen::Index column) {
    std::array<double, 16> values;
    harmonicBasis(degree, d.x(), d.y(), d.z(), values.data());
    for (Eigen::Index k = 0; k < rows; ++k) basis(k, column) = values[static_cast<size_t>(k)];
  };
  Basis shared(rows, columns);
  std::vector<Vec3d> sides(direction_count_);
  for (size_t i = 0; i < direction_count_; ++i) {
    sides[i] =
        Vec3d(static_cast<double>(directions[i * 3]), static_cast<double>(directions[i * 3 + 1]),
              static_cast<double>(directions[i * 3 + 2]));
    basisOf(sides[i], shared, static_cast<Eigen::Index>(i));
  }
  const size_t cell_count = kCellsAlongSide * kCellsAlongSide;
  const size_t per_cell = coefficient_count_ * (direction_count_ + 1);
  solutions_.resize(cell_count * per_cell);
  parallelFor(cell_count, 64, [&](size_t begin, size_t end) {
    Basis basis = shared;
    Eigen::VectorXd weights(columns);
    for (size_t cell = begin; cell < end; ++cell) {
      const Vec3d normal = normalOf(cell);
      for (size_t i = 0; i < direction_count_; ++i) {
        weights[static_cast<Eigen::Index>(i)] = weightOf(-sides[i].dot(normal));
      }
      weights[columns - 1] = 1;
      basisOf(-normal, basis, columns - 1);
      const Basis weighted = basis * weights.asDiagonal();
      Basis matrix = weighted * basis.transpose();
      const double unit = kHolding * weights.sum() / (4 * std::numbers::pi);
      for (Eigen::Index k = 1; k < rows; ++k) {
        const auto l = std::floor(std::sqrt(static_cast<double>(k)));
        matrix(k, k) += unit * l * l * l * l;
      }
      const Basis solution = matrix.ldlt().solve(weighted);
      float* out = &solutions_[cell * per_cell];
      for (Eigen::Index k = 0; k < rows; ++k) {
        for (Eigen::Index i = 0; i < columns; ++i) *out++ = static_cast<float>(solution(k, i));
      }
    }
  });
}

void ViewHarmonics::fit(const float* normal, const float* colour, std::span<const float> added,
                        std::span<float> coefficients) const {
  const size_t columns = direction_count_ + 1;
  const float* solution = &solutions_[cellOf(normal) * coefficient_count_ * columns];
  std::fill(coefficients.begin(), coefficients.end(), 0.0f);
  for (size_t i = 0; i < columns; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const float linear = colour[c] + (i < direction_count_ ? added[i * 3 + c] : 0.0f);
      const float shown = linearToSrgb(std::max(0.0f, linear)) - 0.5f;
      for (size_t k = 0; k < coefficient_count_; ++k) {
        coefficients[k * 3 + c] += solution[k * columns + i] * shown;
      }
    }
  }
}

}  // namespace stipple
