#pragma once

#include <cstddef>
#include <memory>

#include "nn/network_run.h"

namespace stipple {

/// The two products of an attention, of a tile of queries and a tile of keys of one head.
class AttentionProducts {
 public:
  virtual ~AttentionProducts() = default;
  /// Of a tile, at most. Not of the number of threads.
  virtual size_t mostQueries() const = 0;
  virtual size_t mostKeys() const = 0;
  /// Whether weigh() takes weights rounded to bfloat16.
  virtual bool takesNarrow() const = 0;
  /// Floats that a tile of packed keys and values takes.
  virtual size_t packedFloats(size_t keys) const = 0;
  /// In: k and v [keys, head_width]. Out: packed [packedFloats()].
  virtual void pack(size_t keys, const float* k, size_t k_stride, const float* v, size_t v_stride,
                    float* packed) const = 0;
  /// scores [queries, keys] = q k^T.
  virtual void score(size_t queries, size_t keys, const float* q, size_t q_stride,
                     const float* packed, float* scores) const = 0;
  /// sums [queries, head_width] = weights [queries, keys] v, or added to them where they have
  /// begun. In: weights, in bfloat16 where takesNarrow().
  virtual void weigh(size_t queries, size_t keys, const void* weights, const float* packed,
                     bool has_begun, float* sums) const = 0;
};

/// In float32 by our own kernels, or in bfloat16 by the backend of a run that has it.
std::unique_ptr<AttentionProducts> makeAttentionProducts(const NetworkRun& run, size_t head_width);

}  // namespace stipple
