#include "motion/turn_kernel.h"

#include "math/spherical_harmonics.h"

// The rotation of the polar decomposition by Newton's iteration with scaling (Higham, Computing the
// Polar Decomposition - with Applications, SIAM J. Sci. Stat. Comput. 1986), with lanes along the
// splats; then the turned function's values in as many directions as a band has coefficients.
// Products and sums are fused where the processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "motion/turn_kernel_vector.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using TurnTag = hn::ScalableTag<float>;

/// A vector that looks like a number to harmonicBasis.
struct Many {
  hn::Vec<TurnTag> v;

  Many() : v(hn::Zero(TurnTag())) {}
  explicit Many(hn::Vec<TurnTag> lanes) : v(lanes) {}
  explicit Many(double value) : v(hn::Set(TurnTag(), static_cast<float>(value))) {}

  friend HWY_INLINE Many operator+(Many a, Many b) { return Many(hn::Add(a.v, b.v)); }
  friend HWY_INLINE Many operator-(Many a, Many b) { return Many(hn::Sub(a.v, b.v)); }
  friend HWY_INLINE Many operator*(Many a, Many b) { return Many(hn::Mul(a.v, b.v)); }
  friend HWY_INLINE Many operator-(Many a) { return Many(hn::Neg(a.v)); }
};

#include "math/harmonic_basis-inl.h"

constexpr size_t kMostLanes = HWY_MAX_BYTES / sizeof(float);
constexpr size_t kMostCoefficients = 25;

/// a b + c
HWY_INLINE Many fused(Many a, Many b, Many c) {
  return Many(hn::MulAdd(a.v, b.v, c.v));
}

HWY_INLINE Many over(Many a, Many b) {
  return Many(hn::Div(a.v, b.v));
}

HWY_INLINE Many root(Many a) {
  return Many(hn::Sqrt(a.v));
}

struct Matrix {
  Many m[9];  ///< row-major
};

HWY_INLINE Many squaredNorm(const Matrix& a) {
  Many sum = a.m[0] * a.m[0];
  for (size_t i = 1; i < 9; ++i) sum = fused(a.m[i], a.m[i], sum);
  return sum;
}

/// The determinant times the transposed inverse.
HWY_INLINE Matrix cofactors(const Matrix& a) {
  const auto minor = [&](size_t p, size_t q, size_t r, size_t s) {
    return Many(hn::MulSub(a.m[p].v, a.m[q].v, hn::Mul(a.m[r].v, a.m[s].v)));
  };
  return {{minor(4, 8, 5, 7), minor(5, 6, 3, 8), minor(3, 7, 4, 6),  //
           minor(2, 7, 1, 8), minor(0, 8, 2, 6), minor(1, 6, 0, 7),  //
           minor(1, 5, 2, 4), minor(2, 3, 0, 5), minor(0, 4, 1, 3)}};
}

/// Stretches of a hundred to one need five steps; the others are for rounding.
constexpr int kMostSteps = 10;
/// Squared length of a step after which the next one is below the rounding of float32.
constexpr double kLastStep = 1e-8;

/// The nearest rotation. In: positive determinants.
HWY_INLINE Matrix nearestRotation(TurnTag d, Matrix a) {
  for (int step = 0; step < kMostSteps; ++step) {
    const Matrix inverse = cofactors(a);
    const Many determinant =
        fused(a.m[0], inverse.m[0], fused(a.m[1], inverse.m[1], a.m[2] * inverse.m[2]));
    // The mean of g X and (g X)^-T, g such that both are about as large.
    const Many ratio = over(squaredNorm(inverse), squaredNorm(a) * determinant * determinant);
    const Many g = root(root(ratio));
    const Many half = Many(0.5) * g, other = over(Many(0.5), g * determinant);
    Many moved;
    for (size_t i = 0; i < 9; ++i) {
      const Many next = fused(half, a.m[i], other * inverse.m[i]);
      const Many change = next - a.m[i];
      moved = fused(change, change, moved);
      a.m[i] = next;
    }
    if (hn::AllTrue(d, hn::Lt(moved.v, hn::Set(d, static_cast<float>(kLastStep))))) break;
  }
  return a;
}

/// Turns the band of degree L. In: turned [2 degree + 1][25], the basis in the directions that the
/// rotation leads to each telling direction. In and out: sh [(degree+1)^2,3], lanes apart.
template <size_t L>
HWY_INLINE void turnBand(TurnTag d, const Many (*turned)[kMostCoefficients],
                         const HarmonicTelling& telling, float* sh) {
  constexpr size_t kSide = 2 * L + 1;
  float* band = sh + 3 * L * L * kMostLanes;
  for (size_t c = 0; c < 3; ++c) {
    Many in[kSide], values[kSide];
    for (size_t j = 0; j < kSide; ++j) {
      in[j] = Many(hn::Load(d, band + (3 * j + c) * kMostLanes));
    }
    for (size_t k = 0; k < kSide; ++k) {
      Many sum = turned[k][L * L] * in[0];
      for (size_t j = 1; j < kSide; ++j) sum = fused(turned[k][L * L + j], in[j], sum);
      values[k] = sum;
    }
    for (size_t i = 0; i < kSide; ++i) {
      const double* inverse = &telling.coefficients[L][i * kSide];
      Many sum = Many(inverse[0]) * values[0];
      for (size_t k = 1; k < kSide; ++k) sum = fused(Many(inverse[k]), values[k], sum);
      hn::Store(sum.v, d, band + (3 * i + c) * kMostLanes);
    }
  }
}

/// In: deformations [9,stride] of a vector's rows. In and out: sh [(degree+1)^2,3,kMostLanes].
HWY_INLINE void turnLanes(TurnTag d, const float* deformations, size_t stride, int degree,
                          float* sh) {
  const HarmonicTelling& telling = harmonicTelling();
  Matrix deformation;
  for (size_t i = 0; i < 9; ++i) {
    deformation.m[i] = Many(hn::LoadU(d, deformations + i * stride));
  }
  const Matrix r = nearestRotation(d, deformation);
  Many turned[9][kMostCoefficients];
  for (size_t k = 0; k < static_cast<size_t>(2 * degree + 1); ++k) {
    const Vec3d& direction = telling.directions[k];
    const Many x(direction[0]), y(direction[1]), z(direction[2]);
    const auto back = [&](size_t axis) {
      return fused(r.m[axis], x, fused(r.m[3 + axis], y, r.m[6 + axis] * z));
    };
    harmonicBasis(degree, back(0), back(1), back(2), turned[k]);
  }
  turnBand<1>(d, turned, telling, sh);
  if (degree > 1) turnBand<2>(d, turned, telling, sh);
  if (degree > 2) turnBand<3>(d, turned, telling, sh);
  if (degree > 3) turnBand<4>(d, turned, telling, sh);
}

void turnVector(const TurnColumns& splats, size_t count) {
  const TurnTag d;
  const size_t lanes = hn::Lanes(d);
  const auto side = static_cast<size_t>(splats.degree + 1);
  const size_t stride = side * side * 3;
  HWY_ALIGN float sh[3 * kMostCoefficients * kMostLanes];
  HWY_ALIGN float last[9 * kMostLanes];
  for (size_t row = 0; row < count; row += lanes) {
    const size_t rows = HWY_MIN(lanes, count - row);
    const float* deformations = splats.deformations + row;
    size_t apart = splats.stride;
    if (rows < lanes) {
      // The first row once more stands in for those that are not there.
      for (size_t lane = 0; lane < lanes; ++lane) {
        for (size_t i = 0; i < 9; ++i) {
          last[i * kMostLanes + lane] = deformations[i * apart + (lane < rows ? lane : 0)];
        }
      }
      deformations = last;
      apart = kMostLanes;
    }
    float* from = splats.sh + row * stride;
    for (size_t lane = 0; lane < lanes; ++lane) {
      const float* values = from + (lane < rows ? lane : 0) * stride;
      for (size_t k = 3; k < stride; ++k) sh[k * kMostLanes + lane] = values[k];
    }
    turnLanes(d, deformations, apart, splats.degree, sh);
    for (size_t lane = 0; lane < rows; ++lane) {
      for (size_t k = 3; k < stride; ++k) from[lane * stride + k] = sh[k * kMostLanes + lane];
    }
  }
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
TurnKernel namedTurnKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), turnVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedTurnKernel);

std::vector<TurnKernel> turnKernels() {
  return onEveryTarget(scalarTurnKernel(), [] { return HWY_DYNAMIC_DISPATCH(namedTurnKernel)(); });
}

TurnKernel chosenTurnKernel() {
  static const TurnKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedTurnKernel)(), turnKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
