#pragma once

#include "base/progress.h"

namespace stipple {

class MatrixBackend;

/// In which numbers the factors of matrix products are; sums are always float32.
enum class FactorPrecision { kFloat32, kBfloat16 };

/// How a network is run; handed down to every layer.
struct NetworkRun {
  const MatrixBackend* backend = nullptr;  ///< null: defaultMatrixBackend()
  FactorPrecision precision = FactorPrecision::kFloat32;
  Progress* progress = nullptr;  ///< layers ask whether it is cancelled, at least 20 times a second
};

}  // namespace stipple
