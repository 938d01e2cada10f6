#pragma once

#include <cstddef>
#include <span>

#include "nn/network_run.h"

namespace stipple {

/// Rows whose heads lie side by side: number i of head h of row r is
/// values[r * row_stride + h * head_width + i].
struct HeadRows {
  const float* values = nullptr;
  size_t row_stride = 0;
};

struct AttentionShape {
  size_t heads = 1;
  size_t head_width = 64;
  size_t queries = 0;
  size_t keys = 0;
};

/// Per head, out = softmax(scale q kᵀ + key_bias) v. In: q [queries], k and v [keys], as HeadRows;
/// scale: kDefaultScale stands for 1 / sqrt(head_width); key_bias [keys], or empty for none.
/// Out: out [queries, heads * head_width], out_stride floats from row to row; it may be q itself.
/// Threads and determinism: parallel over heads and tiles of queries; same bits for any number of
/// threads. Memory: a tile of scores for each thread, never a whole matrix of them.
constexpr float kDefaultScale = 0.0f;
void attention(const NetworkRun& run, const AttentionShape& shape, HeadRows q, HeadRows k,
               HeadRows v, float* out, size_t out_stride, std::span<const float> key_bias = {},
               float scale = kDefaultScale);

}  // namespace stipple
