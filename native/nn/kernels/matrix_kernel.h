#pragma once

#include <cstddef>
#include <vector>

#include "nn/matmul.h"

namespace stipple {

struct MatrixKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// All rows of `shape`, on this thread.
  void (*multiply)(const MatmulShape& shape, MatrixView a, MatrixView b, RowMatrix c,
                   const float* bias);
  /// out[i] = z[i] / (1 + exp(-z[i])).
  void (*silu)(size_t count, const float* z, float* out);
  /// gradient[i] *= d silu(z[i]) / dz.
  void (*siluBackward)(size_t count, const float* z, float* gradient);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
MatrixKernel chosenMatrixKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<MatrixKernel> matrixKernels();

MatrixKernel scalarMatrixKernel();

}  // namespace stipple
