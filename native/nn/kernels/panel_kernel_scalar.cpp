#include <algorithm>

#include "nn/kernels/panel_kernel.h"

namespace stipple {

namespace {

constexpr size_t kStrip = 8;
/// Numbers of a row that are read before the next row: one cache line.
constexpr size_t kPiece = 16;

void multiplyScalar(const PanelProduct& product) {
  const MatmulShape& shape = product.shape;
  for (size_t row = 0; row < shape.rows; ++row) {
    for (size_t column = 0; column < shape.columns; ++column) {
      float& out = product.c[row * product.c_stride + column];
      float sum = out;
      if (product.start == PanelStart::kBias) {
        sum = product.bias == nullptr ? 0.0f : product.bias[column];
      }
      const float* b = product.b + column / kStrip * shape.inner * kStrip + column % kStrip;
      for (size_t k = 0; k < shape.inner; ++k) {
        const size_t at =
            product.is_turned ? k * product.a_stride + row : row * product.a_stride + k;
        sum += product.a[at] * b[k * kStrip];
      }
      out = sum;
    }
  }
}

}  // namespace

PanelKernel scalarPanelKernel() {
  return {"scalar", kStrip, multiplyScalar};
}

void packColumns(size_t strip, size_t inner, size_t columns, const float* from, size_t stride,
                 float* strips) {
  for (size_t first = 0; first < columns; first += strip) {
    const size_t count = std::min(strip, columns - first);
    for (size_t begin = 0; begin < inner; begin += kPiece) {
      const size_t end = std::min(inner, begin + kPiece);
      for (size_t c = 0; c < count; ++c) {
        const float* row = from + (first + c) * stride;
        for (size_t k = begin; k < end; ++k) strips[k * strip + c] = row[k];
      }
      for (size_t c = count; c < strip; ++c) {
        for (size_t k = begin; k < end; ++k) strips[k * strip + c] = 0.0f;
      }
    }
    strips += inner * strip;
  }
}

void packRows(size_t strip, size_t inner, size_t columns, const float* from, size_t stride,
              float* strips) {
  for (size_t first = 0; first < columns; first += strip) {
    const size_t count = std::min(strip, columns - first);
    for (size_t k = 0; k < inner; ++k) {
      std::copy_n(from + k * stride + first, count, strips + k * strip);
      std::fill(strips + k * strip + count, strips + (k + 1) * strip, 0.0f);
    }
    strips += inner * strip;
  }
}

}  // namespace stipple
