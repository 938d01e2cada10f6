#pragma once

#include <cstddef>

namespace stipple {

/// A linear layer that many rows go through: out [rows, outputs] = in [rows, inputs] weightᵀ +
/// bias, weight [outputs, inputs].
struct NarrowLayer {
  size_t rows = 0, inputs = 0, outputs = 0;
};

// Its products by the default backend, with factors rounded to bfloat16 and sums in float32. The
// backend must have such products (requirePrecision()). Threads and determinism: parallel; same
// bits for any number of threads, since what a task multiplies depends on sizes alone.

/// In: bias [outputs], or null. Out: out, apart from `in`.
void applyNarrow(const NarrowLayer& layer, const float* in, const float* weight, const float* bias,
                 float* out);

/// In: out_gradient [rows, outputs]. Out: weight_gradient [outputs, inputs], which this adds
/// out_gradientᵀ in to; in_gradient [rows, inputs] = out_gradient weight, written over, or null.
void backwardNarrow(const NarrowLayer& layer, const float* in, const float* weight,
                    const float* out_gradient, float* weight_gradient, float* in_gradient);

}  // namespace stipple
