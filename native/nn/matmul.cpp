#include "nn/matmul.h"

#include "base/parallel.h"
#include "nn/kernels/matrix_kernel.h"

namespace stipple {

namespace {

/// Rows of a piece: a multiple of what the kernels take at once (6), and few enough that the
/// transposed products of a layer, whose rows are the layer's inputs, still make several pieces.
constexpr size_t kRows = 12;
/// Multiplications of a piece, below which handing it out costs more than it.
constexpr size_t kLeastWork = 1 << 16;

}  // namespace

void multiply(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
              const float* bias) {
  multiplyWith(chosenMatrixKernel(), shape, a, b, c, bias);
}

void multiplyWith(const MatrixKernel& kernel, const MatmulShape& shape, MatrixView a, MatrixView b,
                  RowMatrix c, const float* bias) {
  const size_t work = kRows * shape.inner * shape.columns;
  const size_t grain = kRows * (1 + kLeastWork / (work + 1));
  parallelFor(shape.rows, grain, [&](size_t begin, size_t end) {
    const MatrixView rows = {a.values + begin * a.row_stride, a.row_stride, a.column_stride};
    kernel.multiply({end - begin, shape.inner, shape.columns}, rows, b,
                    {c.values + begin * c.row_stride, c.row_stride}, bias);
  });
}

}  // namespace stipple
