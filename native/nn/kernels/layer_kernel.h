#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/weight_table.h"
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

/// Scores of queries beside each other while their tiles of keys go by: column c of each row is of
/// query c, and no column hears of another.
struct SoftmaxColumns {
  float* scores = nullptr;  ///< [keys, columns] of this tile; becomes exp(rate score - peak)
  size_t keys = 0;
  size_t columns = 0;
  const float* rates = nullptr;  ///< [keys], finite
  float* peaks = nullptr;        ///< [columns]: the largest so far, any finite number at first
  float* sums = nullptr;         ///< [columns]: of exponentials so far, relative to the peak
  float* out = nullptr;          ///< [width, columns] so far; brought to the new peaks
  size_t width = 0;
};

/// What layers do to numbers one by one, on this thread.
struct LayerKernel {
  const char* target;  ///< "scalar", or Highway's name of an instruction set
  void (*activate)(Activation activation, size_t count, float* values);
  /// gradient[i] *= the derivative of the activation at in[i].
  void (*scaleBySlope)(Activation activation, size_t count, const float* in, float* gradient);
  /// out[i] = silu(gate[i]) up[i].
  void (*siluGate)(size_t count, const float* gate, const float* up, float* out);
  void (*softmax)(SoftmaxRow& row);
  void (*softmaxColumns)(const SoftmaxColumns& tile);
  /// To the nearest bfloat16, of two as near the even one. Infinities and usual NaN stay.
  void (*narrow)(size_t count, const float* from, uint16_t* to);
  /// Numbers of a tensor, of a type that is not kOther, from any address: as widen() of
  /// data/weight_table.h, at the speed of memory. What is not finite, which layers refuse before, may
  /// become any number.
  void (*widen)(WeightType type, size_t count, const uint8_t* bytes, float* to);
};

/// The kernel to use: the best for this processor, or what STIPPLE_FORCE_TARGET names.
const LayerKernel& chosenLayerKernel();
/// Every kernel that is compiled and runs on this processor (base/kernel_choice.h).
std::vector<LayerKernel> layerKernels();
LayerKernel scalarLayerKernel();

}  // namespace stipple
