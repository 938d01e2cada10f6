#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "nn/training/parameter_layout.h"

namespace stipple {

/// Weights to begin with: matrices Xavier-uniform, keyed by the seed; factors of norms 1; all else,
/// and tensors that are silent at first, 0. In: silent: names.
std::vector<float> startWeights(const ParameterLayout& layout, uint64_t seed,
                                std::span<const std::string> silent);

}  // namespace stipple
