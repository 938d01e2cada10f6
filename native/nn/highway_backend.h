#pragma once

#include "nn/matrix_backend.h"

namespace stipple {

/// Our own kernels (nn/kernels/panel_kernel.h): always there, float32 only.
const MatrixBackend& highwayBackend();

}  // namespace stipple
