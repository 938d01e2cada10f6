#pragma once

#include "math/vec.h"

namespace stipple {

/// For folders that know vectors alone, not the rest of the linear algebra library.
inline Vec3d crossProduct(const Vec3d& a, const Vec3d& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace stipple
