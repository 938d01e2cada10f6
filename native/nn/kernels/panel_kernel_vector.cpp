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

/// One strip, kRows rows, `inner` steps.
template <size_t kRows>
HWY_INLINE void multiplyTile(size_t inner, const float* a, size_t a_stride, const float* strip,
                             Vec (&sums)[kRows][2]) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  for (size_t k = 0; k < inner; ++k) {
    const Vec b0 = hn::LoadU(d, strip);
    const Vec b1 = hn::LoadU(d, strip + lanes);
    strip += 2 * lanes;
    for (size_t row = 0; row < kRows; ++row) {
      const Vec factor = hn::Set(d, a[row * a_stride + k]);
      sums[row][0] = hn::MulAdd(factor, b0, sums[row][0]);
      sums[row][1] = hn::MulAdd(factor, b1, sums[row][1]);
    }
  }
}

/// A piece of a product: kRows rows from `row` on, one strip, inner numbers [begin, end).
struct Piece {
  size_t row, column, begin, end;
};

template <size_t kRows>
HWY_NOINLINE void multiplyPiece(const PanelProduct& product, const Piece& piece) {
  const Tag d;
  const size_t lanes = hn::Lanes(d);
  const size_t width = std::min(2 * lanes, product.shape.columns - piece.column);
  const bool is_whole = width == 2 * lanes;
  const bool has_sums = product.start == PanelStart::kSums || piece.begin > 0;
  float* c = product.c + piece.row * product.c_stride + piece.column;
  HWY_ALIGN float edge[2 * hn::MaxLanes(d)] = {};
  Vec sums[kRows][2];
  if (!has_sums) {
    if (product.bias != nullptr) std::copy_n(product.bias + piece.column, width, edge);
    for (size_t row = 0; row < kRows; ++row) {
      sums[row][0] = hn::Load(d, edge);
      sums[row][1] = hn::Load(d, edge + lanes);
    }
  } else {
    for (size_t row = 0; row < kRows; ++row) {
      const float* from = c + row * product.c_stride;
      if (!is_whole) from = std::copy_n(from, width, edge) - width;
      sums[row][0] = hn::LoadU(d, from);
      sums[row][1] = hn::LoadU(d, from + lanes);
    }
  }
  const float* strip = product.b + piece.column * product.shape.inner + piece.begin * 2 * lanes;
  multiplyTile<kRows>(piece.end - piece.begin,
                      product.a + piece.row * product.a_stride + piece.begin, product.a_stride,
                      strip, sums);
  for (size_t row = 0; row < kRows; ++row) {
    float* to = is_whole ? c + row * product.c_stride : edge;
    hn::StoreU(sums[row][0], d, to);
    hn::StoreU(sums[row][1], d, to + lanes);
    if (!is_whole) std::copy_n(edge, width, c + row * product.c_stride);
  }
}

/// As many rows as registers hold, then what is left.
void multiplyRows(const PanelProduct& product, Piece piece, size_t row_end) {
  while (piece.row < row_end) {
    const size_t left = row_end - piece.row;
    if (left >= kMostRows) {
      multiplyPiece<kMostRows>(product, piece);
      piece.row += kMostRows;
    } else if (left >= 6) {
      multiplyPiece<6>(product, piece);
      piece.row += 6;
    } else if (left >= 4) {
      multiplyPiece<4>(product, piece);
      piece.row += 4;
    } else if (left >= 3) {
      multiplyPiece<3>(product, piece);
      piece.row += 3;
    } else {
      multiplyPiece<1>(product, piece);
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
        multiplyRows(product, {row, column, begin, end}, row_end);
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
