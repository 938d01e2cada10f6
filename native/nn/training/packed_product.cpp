#include "nn/training/packed_product.h"

#include <algorithm>

#include "base/parallel.h"
#include "nn/kernels/panel_kernel.h"

namespace stipple {

namespace {

/// Rows of a task, a multiple of what kernels take at once (12).
constexpr size_t kTaskRows = 48;

MatrixView rowsFrom(MatrixView a, size_t row) {
  return {a.values + row * a.row_stride, a.row_stride, a.column_stride};
}
RowMatrix rowsFrom(RowMatrix c, size_t row) {
  return {c.values + row * c.row_stride, c.row_stride};
}

}  // namespace

PackedMatrix::PackedMatrix(size_t inner, size_t columns, MatrixView b)
    : inner_(inner),
      columns_(columns),
      strips_(stripFloats(chosenPanelKernel().strip, inner, columns)) {
  const size_t strip = chosenPanelKernel().strip;
  parallelFor(rangeCount(columns, strip), 1, [&](size_t at, size_t) {
    const size_t first = at * strip, count = std::min(strip, columns - first);
    float* to = strips_.data() + at * strip * inner;
    if (b.column_stride == 1) {
      packRows(strip, inner, count, b.values + first, b.row_stride, to);
    } else {
      packColumns(strip, inner, count, b.values + first * b.column_stride, b.column_stride, to);
    }
  });
}

void PackedMatrix::multiply(size_t rows, MatrixView a, RowMatrix c, const float* bias) const {
  run(rows, a, c, PanelStart::kBias, bias);
}

void PackedMatrix::add(size_t rows, MatrixView a, RowMatrix c) const {
  run(rows, a, c, PanelStart::kSums, nullptr);
}

void PackedMatrix::run(size_t rows, MatrixView a, RowMatrix c, PanelStart start,
                       const float* bias) const {
  PanelProduct product;
  product.shape = {rows, inner_, columns_};
  product.a = a.values;
  product.is_turned = a.column_stride != 1;
  product.a_stride = product.is_turned ? a.column_stride : a.row_stride;
  product.b = strips_.data();
  product.start = start;
  product.bias = bias;
  product.c = c.values;
  product.c_stride = c.row_stride;
  chosenPanelKernel().multiply(product);
}

void multiplyPacked(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                    const float* bias) {
  const PackedMatrix packed(shape.inner, shape.columns, b);
  parallelFor(shape.rows, kTaskRows, [&](size_t begin, size_t end) {
    packed.multiply(end - begin, rowsFrom(a, begin), rowsFrom(c, begin), bias);
  });
}

void addPacked(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c) {
  const PackedMatrix packed(shape.inner, shape.columns, b);
  parallelFor(shape.rows, kTaskRows, [&](size_t begin, size_t end) {
    packed.add(end - begin, rowsFrom(a, begin), rowsFrom(c, begin));
  });
}

}  // namespace stipple
