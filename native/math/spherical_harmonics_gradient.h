#pragma once

namespace stipple {

#include "math/harmonic_basis_gradient-inl.h"

}  // namespace stipple
