#pragma once

#include <string>

#include "nn/matrix_backend.h"

namespace stipple {

/// oneDNN's products, through libstipple_nn.so, which is opened at the first call and stays loaded.
/// Returns null where it cannot be loaded; why: the reason.
const MatrixBackend* onednnBackend(std::string* why = nullptr);

}  // namespace stipple
