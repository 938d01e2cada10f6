#pragma once

#include <cstddef>
#include <vector>

namespace stipple {

/// Splats whose neighbourhood is deformed, as columns, and their harmonics.
struct TurnColumns {
  const float* deformations = nullptr;  ///< [9,stride] row-major matrices, entry by entry
  size_t stride = 0;
  float* sh = nullptr;  ///< [N,(degree+1)^2,3], turned in place
  int degree = 1;       ///< 1..4
};

struct TurnKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// Turns the harmonics of `count` rows with the rotation nearest to each row's deformation.
  /// In: deformations of positive determinant, with stretches between 0.01 and 100.
  /// The plain kernel does it in double (nearestOrthogonal, rotateHarmonics).
  void (*turn)(const TurnColumns& splats, size_t count);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
TurnKernel chosenTurnKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<TurnKernel> turnKernels();

TurnKernel scalarTurnKernel();

}  // namespace stipple
