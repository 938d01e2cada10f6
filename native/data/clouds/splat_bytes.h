#pragma once

#include <cstdint>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Bytes of a cloud of so many splats.
inline uint64_t splatBytes(uint64_t count, int sh_degree) {
  constexpr uint64_t kFloats = 3 + 4 + 3 + 1;  // beside the harmonics
  return count * (kFloats + 3 * shCoefficientCount(sh_degree)) * sizeof(float);
}

}  // namespace stipple
