#pragma once

#include <cstddef>

namespace stipple {

/// A matrix that is read: element (row, column) at values[row * row_stride + column *
/// column_stride], so a transposed one is the same numbers with the strides exchanged.
struct MatrixView {
  const float* values = nullptr;
  size_t row_stride = 0;
  size_t column_stride = 1;
};

/// A matrix that is written: element (row, column) at values[row * row_stride + column].
struct RowMatrix {
  float* values = nullptr;
  size_t row_stride = 0;
};

struct MatmulShape {
  size_t rows = 0;     ///< of a and c
  size_t inner = 0;    ///< columns of a, rows of b
  size_t columns = 0;  ///< of b and c
};

struct MatrixKernel;

/// c = a b, or with `bias` [columns] c = a b + 1 bias^T. In: b with a column stride of 1.
/// Fastest where `columns` is a multiple of 16. Threads and determinism: rows of c in parallel,
/// each element one sum in the order of the inner index: same bits for any number of threads.
/// Numbers: float32, products and sums fused where the processor can.
void multiply(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
              const float* bias = nullptr);

/// The same with a kernel of matrixKernels(): for tests and benchmarks.
void multiplyWith(const MatrixKernel& kernel, const MatmulShape& shape, MatrixView a, MatrixView b,
                  RowMatrix c, const float* bias = nullptr);

}  // namespace stipple
