#pragma once

#include <cstddef>
#include <span>

namespace stipple {

/// out = (in - mean) / sqrt(variance + epsilon) of each row, times weight plus bias where they are
/// given (affine), times 1 + scale plus shift where they are given (modulated).
/// In: in [rows, width]. Out: out [rows, width]; it may be `in`. Mean and variance are sums in
/// double. Threads and determinism: parallel over rows; same bits for any number of threads.
struct LayerNorm {
  size_t width = 0;
  float epsilon = 1e-6f;
  std::span<const float> weight, bias;  ///< [width] or empty
  std::span<const float> scale, shift;  ///< [width] or empty
};
void layerNorm(const LayerNorm& norm, size_t rows, const float* in, float* out);

/// Each head of each row: v / max(|v|, 1e-12) * gamma * sqrt(head_width), in place.
/// In: values [rows, heads * head_width], row_stride floats from row to row; gamma [heads,
/// head_width].
void rmsNormHeads(size_t rows, size_t heads, size_t head_width, std::span<const float> gamma,
                  float* values, size_t row_stride);

}  // namespace stipple
