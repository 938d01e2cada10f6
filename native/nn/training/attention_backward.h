#pragma once

#include "nn/attention.h"

namespace stipple {

/// Derivatives of heads that lie side by side, as HeadRows has them; written over.
struct HeadGradients {
  float* values = nullptr;
  size_t row_stride = 0;
};

/// In: shape, q, k, v as attention() had them, without biases of keys and with the default scale;
/// out, what it made, and the derivative by that. Out: derivatives by q, k and v. Softmax is done
/// again, a tile of queries at a time, so that no whole matrix of scores is ever kept.
/// Threads and determinism: heads in parallel; same bits for any number of threads. Memory: two
/// tiles of kTile x keys, and keys and values once more, for each head that is worked on.
/// Source: T. Dao et al., FlashAttention, NeurIPS 2022, appendix B.2.
void attentionBackward(const AttentionShape& shape, HeadRows q, HeadRows k, HeadRows v,
                       HeadRows out, HeadRows out_gradient, HeadGradients q_gradient,
                       HeadGradients k_gradient, HeadGradients v_gradient);

}  // namespace stipple
