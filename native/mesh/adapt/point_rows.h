#pragma once

#include <cstddef>
#include <span>

#include "math/vec.h"

namespace stipple {

/// Row `i` of an array [N,3].
inline Vec3d rowOf(std::span<const float> rows, size_t i) {
  const Eigen::Map<const Vec3f> row(&rows[i * 3]);
  return row.cast<double>();
}

inline void setRow(std::span<float> rows, size_t i, const Vec3d& value) {
  Eigen::Map<Vec3f> row(&rows[i * 3]);
  row = value.cast<float>();
}

}  // namespace stipple
