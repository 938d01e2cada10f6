#pragma once

#include <cstddef>
#include <vector>

namespace stipple {

/// Splats whose neighbourhood is deformed, as columns.
struct ShapeColumns {
  const float* deformations = nullptr;  ///< [9,stride] row-major matrices, entry by entry
  size_t stride = 0;
  const float* rotations = nullptr;  ///< [N,4] w,x,y,z, unit
  const float* scales = nullptr;     ///< [N,3] >= 0
  float* out_rotations = nullptr;    ///< [N,4] unit
  float* out_scales = nullptr;       ///< [N,3]
};

struct ShapeKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// The splats of `count` rows with covariances F C F^T: axes and standard deviations of what each
  /// deformation F makes of its splat's ellipsoid, in the order of the axes that they come from.
  /// In: deformations of positive determinant, with stretches between 0.01 and 100.
  /// The plain kernel does it in double (math/principal_axes.h).
  void (*deform)(const ShapeColumns& splats, size_t count);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
ShapeKernel chosenShapeKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<ShapeKernel> shapeKernels();

ShapeKernel scalarShapeKernel();

/// Standard deviations below this part of the largest of a splat are raised to it for the axes.
constexpr float kFlatness = 1e-6f;

}  // namespace stipple
