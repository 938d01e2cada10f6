#include <algorithm>
#include <cmath>

#include "nn/kernels/matrix_kernel.h"

// Lanes are columns. The steps of matrix_kernel_scalar.cpp; products and sums are fused where the
// processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/matrix_kernel_vector.cpp"
#include <hwy/foreach_target.h>
// After it, as each target includes the rest anew.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

/// Rows whose sums stay in registers beside each other.
constexpr size_t kBlockRows = 6;

/// kRowCount rows, columns `column` to `column` + 2 vectors.
template <size_t kRowCount>
HWY_INLINE void multiplyPair(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                             const float* bias, size_t column) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const Vec left = bias == nullptr ? hn::Zero(d) : hn::LoadU(d, bias + column);
  const Vec right = bias == nullptr ? hn::Zero(d) : hn::LoadU(d, bias + column + lanes);
  Vec sums[kRowCount][2];
  for (size_t row = 0; row < kRowCount; ++row) {
    sums[row][0] = left;
    sums[row][1] = right;
  }
  const float* from = b.values + column;
  const float* factors = a.values;
  for (size_t k = 0; k < shape.inner; ++k) {
    const Vec b0 = hn::LoadU(d, from);
    const Vec b1 = hn::LoadU(d, from + lanes);
    for (size_t row = 0; row < kRowCount; ++row) {
      const Vec factor = hn::Set(d, factors[row * a.row_stride]);
      sums[row][0] = hn::MulAdd(factor, b0, sums[row][0]);
      sums[row][1] = hn::MulAdd(factor, b1, sums[row][1]);
    }
    from += b.row_stride;
    factors += a.column_stride;
  }
  for (size_t row = 0; row < kRowCount; ++row) {
    hn::StoreU(sums[row][0], d, c.values + row * c.row_stride + column);
    hn::StoreU(sums[row][1], d, c.values + row * c.row_stride + column + lanes);
  }
}

template <size_t kRowCount>
HWY_INLINE void multiplyOne(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                            const float* bias, size_t column) {
  const Tag d;
  const Vec start = bias == nullptr ? hn::Zero(d) : hn::LoadU(d, bias + column);
  Vec sums[kRowCount];
  for (size_t row = 0; row < kRowCount; ++row) sums[row] = start;
  const float* from = b.values + column;
  const float* factors = a.values;
  for (size_t k = 0; k < shape.inner; ++k) {
    const Vec b0 = hn::LoadU(d, from);
    for (size_t row = 0; row < kRowCount; ++row) {
      sums[row] = hn::MulAdd(hn::Set(d, factors[row * a.row_stride]), b0, sums[row]);
    }
    from += b.row_stride;
    factors += a.column_stride;
  }
  for (size_t row = 0; row < kRowCount; ++row) {
    hn::StoreU(sums[row], d, c.values + row * c.row_stride + column);
  }
}

template <size_t kRowCount>
HWY_INLINE void multiplyBlock(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                              const float* bias) {
  const size_t lanes = hn::Lanes(Tag());
  size_t column = 0;
  for (; column + 2 * lanes <= shape.columns; column += 2 * lanes) {
    multiplyPair<kRowCount>(shape, a, b, c, bias, column);
  }
  for (; column + lanes <= shape.columns; column += lanes) {
    multiplyOne<kRowCount>(shape, a, b, c, bias, column);
  }
  for (; column < shape.columns; ++column) {
    for (size_t row = 0; row < kRowCount; ++row) {
      float sum = bias == nullptr ? 0.0f : bias[column];
      for (size_t k = 0; k < shape.inner; ++k) {
        sum += a.values[row * a.row_stride + k * a.column_stride] *
               b.values[k * b.row_stride + column];
      }
      c.values[row * c.row_stride + column] = sum;
    }
  }
}

void multiplyVector(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                    const float* bias) {
  size_t row = 0;
  const auto at = [&](size_t r) {
    return MatrixView{a.values + r * a.row_stride, a.row_stride, a.column_stride};
  };
  const auto to = [&](size_t r) { return RowMatrix{c.values + r * c.row_stride, c.row_stride}; };
  for (; row + kBlockRows <= shape.rows; row += kBlockRows) {
    multiplyBlock<kBlockRows>(shape, at(row), b, to(row), bias);
  }
  for (; row < shape.rows; ++row) multiplyBlock<1>(shape, at(row), b, to(row), bias);
}

/// exp(-z) stays finite: beyond 80 the logistic is 0 or 1 to float32 all the same.
HWY_INLINE Vec logisticOf(Tag d, Vec z) {
  const Vec held = hn::Min(hn::Max(z, hn::Set(d, -80.0f)), hn::Set(d, 80.0f));
  const Vec one = hn::Set(d, 1.0f);
  return hn::Div(one, hn::Add(one, hn::Exp(d, hn::Neg(held))));
}

HWY_INLINE Vec siluOf(Tag d, Vec z) {
  return hn::Mul(z, logisticOf(d, z));
}

HWY_INLINE Vec siluSlope(Tag d, Vec z) {
  const Vec s = logisticOf(d, z);
  const Vec one = hn::Set(d, 1.0f);
  return hn::Mul(s, hn::MulAdd(z, hn::Sub(one, s), one));
}

void siluVector(size_t count, const float* z, float* out) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(siluOf(d, hn::LoadU(d, z + i)), d, out + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  std::copy(z + i, z + count, rest);
  hn::Store(siluOf(d, hn::Load(d, rest)), d, rest);
  std::copy_n(rest, count - i, out + i);
}

void siluBackwardVector(size_t count, const float* z, float* gradient) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const Vec slope = siluSlope(d, hn::LoadU(d, z + i));
    hn::StoreU(hn::Mul(hn::LoadU(d, gradient + i), slope), d, gradient + i);
  }
  if (i == count) return;
  HWY_ALIGN float rest[hn::MaxLanes(d)] = {};
  std::copy(z + i, z + count, rest);
  hn::Store(siluSlope(d, hn::Load(d, rest)), d, rest);
  for (size_t k = i; k < count; ++k) gradient[k] *= rest[k - i];
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
MatrixKernel namedMatrixKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET), multiplyVector,
          siluVector, siluBackwardVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedMatrixKernel);

std::vector<MatrixKernel> matrixKernels() {
  return onEveryTarget(scalarMatrixKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedMatrixKernel)(); });
}

MatrixKernel chosenMatrixKernel() {
  static const MatrixKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedMatrixKernel)(), matrixKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
