// Based on: M. Milakov, N. Gimelshein, Online normalizer calculation for softmax, arXiv 1805.02867,
// 2018; T. Dao et al., FlashAttention, NeurIPS 2022, algorithm 1, without its backward pass.
#include "nn/attention.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/layer_kernel.h"
#include "nn/panel_kernel.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// A tile of scores takes 128 KiB and stays in a second cache; queries are a multiple of the rows
/// that kernels take at once (12).
constexpr size_t kQueries = 120;
constexpr size_t kKeys = 256;
/// Floats of packed keys and values at a time, 32 MiB, or one head's.
constexpr size_t kMostPacked = size_t{1} << 23;

/// Keys and values of some heads in strips, a tile of keys after the other.
struct PackedHeads {
  const PanelKernel& kernel;
  const AttentionShape& shape;
  size_t key_tiles = rangeCount(shape.keys, kKeys);
  size_t keys_floats = stripFloats(kernel.strip, shape.head_width, kKeys);
  size_t values_floats = stripFloats(kernel.strip, kKeys, shape.head_width);
  float* floats = nullptr;

  size_t headFloats() const { return key_tiles * (keys_floats + values_floats); }
  float* keysOf(size_t head, size_t tile) const {
    return floats + head * headFloats() + tile * (keys_floats + values_floats);
  }
  float* valuesOf(size_t head, size_t tile) const { return keysOf(head, tile) + keys_floats; }
};

struct Attention {
  const AttentionShape& shape;
  HeadRows q, k, v;
  float* out;
  size_t out_stride;
  std::span<const float> key_bias;
  float scale;
};

void packTile(const PackedHeads& packed, const Attention& work, size_t slot, size_t head,
              size_t tile) {
  const size_t first = tile * kKeys;
  const size_t count = std::min(kKeys, work.shape.keys - first);
  const size_t width = work.shape.head_width;
  packColumns(packed.kernel.strip, width, count,
              work.k.values + first * work.k.row_stride + head * width, work.k.row_stride,
              packed.keysOf(slot, tile));
  packRows(packed.kernel.strip, count, width,
           work.v.values + first * work.v.row_stride + head * width, work.v.row_stride,
           packed.valuesOf(slot, tile));
}

/// Queries [first, first + count) of a head. In: room for kQueries * (kKeys + head_width) floats.
void attendTile(const PackedHeads& packed, const Attention& work, size_t slot, size_t head,
                size_t first, size_t count, float* room) {
  const LayerKernel& layer = chosenLayerKernel();
  const size_t width = work.shape.head_width;
  float* scores = room;
  float* sums = room + kQueries * kKeys;
  float peaks[kQueries], weights[kQueries];
  // Finite, so that its difference to a score of minus infinity is no NaN.
  std::fill_n(peaks, count, std::numeric_limits<float>::lowest());
  std::fill_n(weights, count, 0.0f);
  for (size_t tile = 0; tile < packed.key_tiles; ++tile) {
    const size_t first_key = tile * kKeys;
    const size_t keys = std::min(kKeys, work.shape.keys - first_key);
    PanelProduct product;
    product.shape = {count, width, keys};
    product.a = work.q.values + first * work.q.row_stride + head * width;
    product.a_stride = work.q.row_stride;
    product.b = packed.keysOf(slot, tile);
    product.c = scores;
    product.c_stride = kKeys;
    packed.kernel.multiply(product);
    for (size_t i = 0; i < count; ++i) {
      SoftmaxRow row;
      row.scores = scores + i * kKeys;
      row.keys = keys;
      row.scale = work.scale;
      row.key_bias = work.key_bias.empty() ? nullptr : work.key_bias.data() + first_key;
      row.peak = peaks[i];
      row.sum = weights[i];
      row.out = sums + i * width;
      row.width = tile == 0 ? 0 : width;
      layer.softmax(row);
      peaks[i] = row.peak;
      weights[i] = row.sum;
    }
    product.shape = {count, keys, width};
    product.a = scores;
    product.a_stride = kKeys;
    product.b = packed.valuesOf(slot, tile);
    product.start = tile == 0 ? PanelStart::kBias : PanelStart::kSums;
    product.c = sums;
    product.c_stride = width;
    packed.kernel.multiply(product);
  }
  for (size_t i = 0; i < count; ++i) {
    // No key counts where all biases are minus infinity.
    const float factor = weights[i] > 0.0f ? 1.0f / weights[i] : 0.0f;
    float* to = work.out + (first + i) * work.out_stride + head * width;
    for (size_t k = 0; k < width; ++k) to[k] = sums[i * width + k] * factor;
  }
}

}  // namespace

void attention(const NetworkRun& run, const AttentionShape& shape, HeadRows q, HeadRows k,
               HeadRows v, float* out, size_t out_stride, std::span<const float> key_bias,
               float scale) {
  if (shape.queries == 0) return;
  if (shape.keys == 0) fail(ErrorCode::kInvalidArgument, "an attention has 0 keys; 1 is needed");
  const float rate =
      scale != kDefaultScale ? scale : 1.0f / std::sqrt(static_cast<float>(shape.head_width));
  const Attention work = {shape, q, k, v, out, out_stride, key_bias, rate};
  PackedHeads packed{chosenPanelKernel(), shape};
  const size_t most_heads = std::clamp<size_t>(kMostPacked / packed.headFloats(), 1, shape.heads);
  Scratch memory(packed.headFloats() * most_heads);
  packed.floats = memory.data();
  const size_t query_tiles = rangeCount(shape.queries, kQueries);
  const auto throwIfCancelled = [&] {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
  };
  for (size_t first = 0; first < shape.heads; first += most_heads) {
    const size_t heads = std::min(most_heads, shape.heads - first);
    parallelFor(heads * packed.key_tiles, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t slot = begin / packed.key_tiles;
      packTile(packed, work, slot, first + slot, begin % packed.key_tiles);
    });
    parallelFor(heads * query_tiles, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t slot = begin / query_tiles;
      const size_t query = begin % query_tiles * kQueries;
      Scratch room(kQueries * (kKeys + shape.head_width));
      attendTile(packed, work, slot, first + slot, query, std::min(kQueries, shape.queries - query),
                 room.data());
    });
  }
}

}  // namespace stipple
