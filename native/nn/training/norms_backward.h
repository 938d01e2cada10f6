#pragma once

#include <cstddef>
#include <span>

#include "nn/norms.h"

namespace stipple {

/// Derivatives by what a LayerNorm is given, [width] each, which are added to; null where nobody
/// wants them.
struct LayerNormGradients {
  float* weight = nullptr;
  float* bias = nullptr;
  float* scale = nullptr;
  float* shift = nullptr;
};

/// In: norm and in [rows, width] as layerNorm() had them; out_gradient [rows, width]. Out: what
/// `gradients` names, and in_gradient [rows, width], all of which this adds to. Means, variances
/// and sums are in double. Threads and determinism: parallel; same bits for any number of threads.
void layerNormBackward(const LayerNorm& norm, size_t rows, const float* in,
                       const float* out_gradient, const LayerNormGradients& gradients,
                       float* in_gradient);

/// In: rows, heads, head_width, gamma as rmsNormHeads() had them; in: its values before, in_stride
/// floats from row to row; gradient: the derivative by what it made, gradient_stride. Out:
/// gradient, by what it was given, in its place; gamma_gradient [heads, head_width], which this
/// adds to. Heads shorter than 1e-12 have the derivative of a factor that does not change.
void rmsNormHeadsBackward(size_t rows, size_t heads, size_t head_width,
                          std::span<const float> gamma, const float* in, size_t in_stride,
                          float* gradient, size_t gradient_stride, float* gamma_gradient);

/// Of addScaled(): x += factor y. In: y [rows, width]; x_gradient [rows, width]. Out: y_gradient
/// [rows, width], written over; factor_gradient [width], which this adds to.
void addScaledBackward(size_t rows, size_t width, std::span<const float> factor, const float* y,
                       const float* x_gradient, float* y_gradient, float* factor_gradient);

}  // namespace stipple
