#include <cmath>

#include "nn/kernels/matrix_kernel.h"

namespace stipple {

namespace {

void multiplyScalar(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                    const float* bias) {
  for (size_t row = 0; row < shape.rows; ++row) {
    float* out = c.values + row * c.row_stride;
    for (size_t column = 0; column < shape.columns; ++column) {
      out[column] = bias == nullptr ? 0.0f : bias[column];
    }
    for (size_t k = 0; k < shape.inner; ++k) {
      const float factor = a.values[row * a.row_stride + k * a.column_stride];
      const float* from = b.values + k * b.row_stride;
      for (size_t column = 0; column < shape.columns; ++column) {
        out[column] += factor * from[column];
      }
    }
  }
}

/// exp(-z) stays finite: beyond 80 the logistic is 0 or 1 to float32 all the same.
float logistic(float z) {
  return 1.0f / (1.0f + std::exp(-std::fmin(std::fmax(z, -80.0f), 80.0f)));
}

void siluScalar(size_t count, const float* z, float* out) {
  for (size_t i = 0; i < count; ++i) out[i] = z[i] * logistic(z[i]);
}

void siluBackwardScalar(size_t count, const float* z, float* gradient) {
  for (size_t i = 0; i < count; ++i) {
    const float s = logistic(z[i]);
    gradient[i] *= s * (1.0f + z[i] * (1.0f - s));
  }
}

}  // namespace

MatrixKernel scalarMatrixKernel() {
  return {"scalar", multiplyScalar, siluScalar, siluBackwardScalar};
}

}  // namespace stipple
