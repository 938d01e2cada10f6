#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "nn/activations.h"

namespace stipple {

/// A row of scores of an attention while its tiles of keys go by.
struct SoftmaxRow {
  float* scores = nullptr;  ///< [keys] of this tile; becomes exp(scale score + bias - peak)
  size_t keys = 0;
  float scale = 1.0f;
  const float* key_bias = nullptr;  ///< [keys], or null for none
  float peak = 0.0f;                ///< the largest so far
  float sum = 0.0f;                 ///< of exponentials so far, relative to the peak
  float* out = nullptr;             ///< [width] so far; brought to the new peak
  size_t width = 0;
  /// [keys], or null. Exponentials go there rounded to bfloat16, and scores may keep anything.
  uint16_t* narrow = nullptr;
};

/// What layers do to numbers one by one, on this thread.
struct LayerKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set
  void (*activate)(Activation activation, size_t count, float* values);
  /// out[i] = silu(gate[i]) up[i].
  void (*siluGate)(size_t count, const float* gate, const float* up, float* out);
  void (*softmax)(SoftmaxRow& row);
  /// To the nearest bfloat16, of two as near the even one. Infinities and usual NaN stay.
  void (*narrow)(size_t count, const float* from, uint16_t* to);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
const LayerKernel& chosenLayerKernel();
/// Every kernel that is compiled and runs on this processor (base/kernel_choice.h).
std::vector<LayerKernel> layerKernels();
LayerKernel scalarLayerKernel();

}  // namespace stipple
