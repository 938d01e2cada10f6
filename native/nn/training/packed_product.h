#pragma once

#include <cstddef>

#include "nn/kernels/panel_kernel.h"
#include "nn/matmul.h"
#include "nn/scratch.h"

namespace stipple {

/// A matrix b [inner, columns] as products with many rows read it: in strips that lie in order.
class PackedMatrix {
 public:
  /// In: b with a stride of 1 along its rows or along its columns. Threads: parallel.
  PackedMatrix(size_t inner, size_t columns, MatrixView b);

  /// c = a b, or a b + 1 biasᵀ. In: a [rows, inner] with a stride of 1 in one direction; bias
  /// [columns], or null. On this thread. Each element is one sum in the order of the inner index:
  /// the same bits as multiply() of nn/matmul.h has, but for columns that fill no vector there.
  void multiply(size_t rows, MatrixView a, RowMatrix c, const float* bias = nullptr) const;
  /// c += a b: sums begin with what is in c.
  void add(size_t rows, MatrixView a, RowMatrix c) const;

 private:
  void run(size_t rows, MatrixView a, RowMatrix c, PanelStart start, const float* bias) const;

  size_t inner_, columns_;
  Scratch strips_;
};

/// c = a b, or a b + 1 biasᵀ, for many rows. In: a and b with a stride of 1 in one direction.
/// Threads and determinism: rows of c in parallel; same bits for any number of threads.
void multiplyPacked(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                    const float* bias = nullptr);
/// c += a b, in the same way.
void addPacked(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c);

}  // namespace stipple
