#pragma once

#include <cstdint>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Bytes of the arrays of a cloud. In: count below 2^48.
inline uint64_t cloudBytes(uint64_t count, int sh_degree) {
  constexpr uint64_t kBesideHarmonics = 11;  // position, rotation, scale, opacity
  return count * (kBesideHarmonics + shCoefficientCount(sh_degree) * 3) * sizeof(float);
}

}  // namespace stipple
