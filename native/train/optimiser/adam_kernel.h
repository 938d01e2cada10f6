#pragma once

#include <cstddef>
#include <vector>

#include "train/optimiser/adam.h"

namespace stipple {

/// What a step needs, rounded once from double.
struct AdamFactors {
  float first_share;          ///< 1 - beta1
  float second_share;         ///< 1 - beta2
  float rate;                 ///< learning rate / (1 - beta1^step)
  float inverse_root_second;  ///< 1 / sqrt(1 - beta2^step)
  float epsilon;
};

struct AdamKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set ("AVX2")
  /// Steps `count` elements. Returns whether all gradients could be used.
  bool (*step)(const AdamFactors& factors, size_t count, float* parameters, const float* gradients,
               float* first_moments, float* second_moments);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
AdamKernel chosenAdamKernel();

/// Every kernel that is compiled and runs on this processor, "scalar" first. It changes Highway's
/// global choice for a moment: for tests and for STIPPLE_FORCE_TARGET.
std::vector<AdamKernel> adamKernels();

AdamKernel scalarAdamKernel();

}  // namespace stipple
