#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "math/vec.h"

namespace stipple {

/// Adam with one scale for all numbers: the largest of the second moments, so that the direction of
/// the mean gradient is kept.
/// Source: Nicolet, Jacobson, Jakob, Large Steps in Inverse Rendering of Geometry, SIGGRAPH Asia
/// 2021, section 4.
class AdamUniform {
 public:
  AdamUniform(size_t count, double step_size);
  /// values [count] -= share * step_size * first moment / (1e-8 + the largest root of a second
  /// moment), both corrected for their start at 0. One thread. Cost: O(count).
  void step(std::span<Vec3d> values, std::span<const Vec3d> gradient, double share = 1.0);

 private:
  double step_size_;
  double first_share_ = 1, second_share_ = 1;  ///< of the start, in the moments
  std::vector<Vec3d> first_, second_;
};

}  // namespace stipple
