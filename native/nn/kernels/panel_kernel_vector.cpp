#include <algorithm>

#include "nn/kernels/panel_kernel.h"

// Lanes are columns; a strip is two vectors wide. The steps of panel_kernel_scalar.cpp; products
// and sums are fused where the processor can, so targets differ by rounding.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nn/kernels/panel_kernel_vector.cpp"
#include <hwy/foreach_target.h>
// After it, as each target includes the rest anew.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace stipple {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

/// Rows whose sums stay in registers beside each other: 24 of 32 vector registers where vectors are
/// of 64 bytes, 12 of 16 otherwise.
constexpr size_t kMostRows = HWY_MAX_BYTES >= 64 ? 12 : 6;
/// A strip of that many rows stays in the first cache (32 KiB of 64-byte vectors), and is used for
/// all rows of a block, whose piece of `a` stays in the second (96 KiB).
constexpr size_t kInner = 256;
constexpr size_t kBlockRows = 96;

/// One strip or its first vector, kRows rows, `inner` steps.
template <bool kTurned, size_t kRows, size_t kVectors>
HWY_INLINE void multiplyTile(size_t inner, const float* a, size_t a_stride, const float* strip,
                             Vec (&sums)[kRows][kVectors]) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  for (size_t k = 0; k < inner; ++k) {
    Vec b[kVectors];
    for (size_t v = 0; v < kVectors; ++v) b[v] = hn::LoadU(d, strip + v * lanes);
    strip += 2 * lanes;
    for (size_t row = 0; row < kRows; ++row) {
      const Vec factor = hn::Set(d, a[kTurned ? k * a_stride + row : row * a_stride + k]);
      for (size_t v = 0; v < kVectors; ++v) {
        sums[row][v] = hn::MulAdd(factor, b[v], sums[row][v]);
      }
    }
  }
}

/// A piece of a product: kRows rows from `row` on, one strip, inner numbers [begin, end).
struct Piece {
  size_t row, column, begin, end;
};

/// In: kVectors: 2, or 1 where one vector has all columns that are left.
template <size_t kRows, size_t kVectors>
HWY_NOINLINE void multiplyPiece(const PanelProduct& product, const Piece& piece) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const size_t width = std::min(kVectors * lanes, product.shape.columns - piece.column);
  const bool is_whole = width == kVectors * lanes;
  const bool has_sums = product.start == PanelStart::kSums || piece.begin > 0;
  float* c = product.c + piece.row * product.c_stride + piece.column;
  HWY_ALIGN float edge[kVectors * hn::MaxLanes(d)] = {};
  Vec sums[kRows][kVectors];
  if (!has_sums) {
    if (product.bias != nullptr) std::copy_n(product.bias + piece.column, width, edge);
    for (size_t row = 0; row < kRows; ++row) {
      for (size_t v = 0; v < kVectors; ++v) sums[row][v] = hn::Load(d, edge + v * lanes);
    }
  } else {
    for (size_t row = 0; row < kRows; ++row) {
      const float* from = c + row * product.c_stride;
      if (!is_whole) from = std::copy_n(from, width, edge) - width;
      for (size_t v = 0; v < kVectors; ++v) sums[row][v] = hn::LoadU(d, from + v * lanes);
    }
  }
  const float* strip = product.b + piece.column * product.shape.inner + piece.begin * 2 * lanes;
  if (product.is_turned) {
    multiplyTile<true, kRows>(piece.end - piece.begin,
                              product.a + piece.begin * product.a_stride + piece.row,
                              product.a_stride, strip, sums);
  } else {
    multiplyTile<false, kRows>(piece.end - piece.begin,
                               product.a + piece.row * product.a_stride + piece.begin,
                               product.a_stride, strip, sums);
  }
  for (size_t row = 0; row < kRows; ++row) {
    float* to = is_whole ? c + row * product.c_stride : edge;
    for (size_t v = 0; v < kVectors; ++v) hn::StoreU(sums[row][v], d, to + v * lanes);
    if (!is_whole) std::copy_n(edge, width, c + row * product.c_stride);
  }
}

/// As many rows as registers hold, then what is left.
template <size_t kVectors>
void multiplyRows(const PanelProduct& product, Piece piece, size_t row_end) {
  while (piece.row < row_end) {
    const size_t left = row_end - piece.row;
    if (left >= kMostRows) {
      multiplyPiece<kMostRows, kVectors>(product, piece);
      piece.row += kMostRows;
    } else if (left >= 6) {
      multiplyPiece<6, kVectors>(product, piece);
      piece.row += 6;
    } else if (left >= 4) {
      multiplyPiece<4, kVectors>(product, piece);
      piece.row += 4;
    } else if (left >= 3) {
      multiplyPiece<3, kVectors>(product, piece);
      piece.row += 3;
    } else {
      multiplyPiece<1, kVectors>(product, piece);
      piece.row += 1;
    }
  }
}

void multiplyVector(const PanelProduct& product) {
  const MatmulShape& shape = product.shape;
  const size_t strip = 2 * hn::Lanes(Tag());
  // An empty sum is the bias all the same.
  const size_t inner_end = std::max<size_t>(shape.inner, 1);
  for (size_t begin = 0; begin < inner_end; begin += kInner) {
    const size_t end = std::min(shape.inner, begin + kInner);
    for (size_t row = 0; row < shape.rows; row += kBlockRows) {
      const size_t row_end = std::min(shape.rows, row + kBlockRows);
      for (size_t column = 0; column < shape.columns; column += strip) {
        const Piece piece = {row, column, begin, end};
        if (2 * (shape.columns - column) <= strip) {
          multiplyRows<1>(product, piece, row_end);
        } else {
          multiplyRows<2>(product, piece, row_end);
        }
      }
    }
  }
}

/// Highway's own one-lane target is not the plain kernel, which has the name "scalar".
PanelKernel namedPanelKernel() {
  return {HWY_TARGET == HWY_SCALAR ? "highway_scalar" : hwy::TargetName(HWY_TARGET),
          2 * hn::Lanes(Tag()), multiplyVector};
}

}  // namespace HWY_NAMESPACE
}  // namespace stipple
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

#include "base/kernel_choice.h"

namespace stipple {

HWY_EXPORT(namedPanelKernel);

std::vector<PanelKernel> panelKernels() {
  return onEveryTarget(scalarPanelKernel(),
                       [] { return HWY_DYNAMIC_DISPATCH(namedPanelKernel)(); });
}

const PanelKernel& chosenPanelKernel() {
  static const PanelKernel kernel =
      chooseKernel(HWY_DYNAMIC_DISPATCH(namedPanelKernel)(), panelKernels);
  return kernel;
}

}  // namespace stipple

#endif  // HWY_ONCE
