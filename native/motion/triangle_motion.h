#pragma once

#include <array>
#include <span>

#include "math/vec.h"
#include "motion/surface_binding.h"

namespace stipple {

/// What a triangle does to its neighbourhood: x goes to place + linear (x - rest).
struct TriangleMotion {
  std::array<float, 3> rest{};    ///< its first corner at rest
  std::array<float, 3> place{};   ///< and now
  std::array<float, 9> linear{};  ///< row-major
  std::array<float, 9> shape{};   ///< likewise, with stretches within kLargestStretch
};

/// The frame of a triangle, as columns: two edges, and the unit normal times the root of the area
/// over that of the triangle at rest. Zero normal: it has no area.
struct TriangleFrame {
  Mat3d axes;
  double area;  ///< twice the area
};

/// In: positions [V,3] of which the three corners are used.
TriangleFrame triangleFrame(std::span<const float> positions, const uint32_t* corners);

/// A linear map with stretches between 1 / kLargestStretch and kLargestStretch and a positive
/// determinant, as near to the given one as that allows.
Mat3d boundedStretch(const Mat3d& linear);

/// What the triangle `corners` of two shapes of a mesh does. In: it has an area at rest.
TriangleMotion triangleMotion(std::span<const float> rest, std::span<const float> deformed,
                              const uint32_t* corners);

}  // namespace stipple
