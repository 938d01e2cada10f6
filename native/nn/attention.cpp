// Based on: M. Milakov, N. Gimelshein, Online normalizer calculation for softmax, arXiv 1805.02867,
// 2018; T. Dao et al., FlashAttention, NeurIPS 2022, algorithm 1, without its backward pass.
#include "nn/attention.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/attention_products.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// Floats of packed keys and values at a time, 32 MiB, or one head's.
constexpr size_t kMostPacked = size_t{1} << 23;

struct Attention {
  const AttentionShape& shape;
  const AttentionProducts& products;
  HeadRows q, k, v;
  float* out;
  size_t out_stride;
  std::span<const float> key_bias;
  float scale;
};

/// Keys and values of some heads, packed a tile of keys after the other.
struct PackedHeads {
  size_t tiles = 0;
  size_t tile_keys = 0;    ///< of every tile but the last
  size_t tile_floats = 0;  ///< at most
  float* floats = nullptr;

  float* at(size_t slot, size_t tile) const { return floats + (slot * tiles + tile) * tile_floats; }
};

PackedHeads layOut(const AttentionProducts& products, size_t keys) {
  PackedHeads packed;
  packed.tile_keys = std::min(products.mostKeys(), keys);
  packed.tiles = rangeCount(keys, packed.tile_keys);
  const size_t last = keys - (packed.tiles - 1) * packed.tile_keys;
  packed.tile_floats =
      std::max(products.packedFloats(packed.tile_keys), products.packedFloats(last));
  return packed;
}

void packTile(const PackedHeads& packed, const Attention& work, size_t slot, size_t head,
              size_t tile) {
  const size_t first = tile * packed.tile_keys;
  const size_t offset = head * work.shape.head_width;
  work.products.pack(std::min(packed.tile_keys, work.shape.keys - first),
                     work.k.values + first * work.k.row_stride + offset, work.k.row_stride,
                     work.v.values + first * work.v.row_stride + offset, work.v.row_stride,
                     packed.at(slot, tile));
}

/// Queries [first, first + count) of a head.
void attendTile(const PackedHeads& packed, const Attention& work, size_t slot, size_t head,
                size_t first, size_t count) {
  const LayerKernel& layer = chosenLayerKernel();
  const size_t width = work.shape.head_width;
  const bool is_narrow = work.products.takesNarrow();
  const size_t narrow_floats = is_narrow ? (count * packed.tile_keys + 1) / 2 : 0;
  Scratch room(count * (packed.tile_keys + width + 2) + narrow_floats);
  float* scores = room.data();
  float* sums = scores + count * packed.tile_keys;
  float* peaks = sums + count * width;
  float* weights = peaks + count;
  auto* narrow = reinterpret_cast<uint16_t*>(weights + count);
  // Finite, so that its difference to a score of minus infinity is no NaN.
  std::fill_n(peaks, count, std::numeric_limits<float>::lowest());
  std::fill_n(weights, count, 0.0f);
  for (size_t tile = 0; tile < packed.tiles; ++tile) {
    const size_t first_key = tile * packed.tile_keys;
    const size_t keys = std::min(packed.tile_keys, work.shape.keys - first_key);
    work.products.score(count, keys, work.q.values + first * work.q.row_stride + head * width,
                        work.q.row_stride, packed.at(slot, tile), scores);
    for (size_t i = 0; i < count; ++i) {
      SoftmaxRow row;
      row.scores = scores + i * keys;
      row.keys = keys;
      row.scale = work.scale;
      row.key_bias = work.key_bias.empty() ? nullptr : work.key_bias.data() + first_key;
      row.peak = peaks[i];
      row.sum = weights[i];
      row.out = sums + i * width;
      row.width = tile == 0 ? 0 : width;
      if (is_narrow) row.narrow = narrow + i * keys;
      layer.softmax(row);
      peaks[i] = row.peak;
      weights[i] = row.sum;
    }
    const void* powers = is_narrow ? static_cast<const void*>(narrow) : scores;
    work.products.weigh(count, keys, powers, packed.at(slot, tile), tile > 0, sums);
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
  const std::unique_ptr<AttentionProducts> products = makeAttentionProducts(run, shape.head_width);
  const Attention work = {shape, *products, q, k, v, out, out_stride, key_bias, rate};
  PackedHeads packed = layOut(*products, shape.keys);
  const size_t head_floats = packed.tiles * packed.tile_floats;
  const size_t most_heads = std::clamp<size_t>(kMostPacked / head_floats, 1, shape.heads);
  Scratch memory(head_floats * most_heads);
  packed.floats = memory.data();
  const size_t tile_queries = products->mostQueries();
  const size_t query_tiles = rangeCount(shape.queries, tile_queries);
  const auto throwIfCancelled = [&] {
    if (run.progress != nullptr) run.progress->throwIfCancelled();
  };
  for (size_t first = 0; first < shape.heads; first += most_heads) {
    const size_t heads = std::min(most_heads, shape.heads - first);
    parallelFor(heads * packed.tiles, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t slot = begin / packed.tiles;
      packTile(packed, work, slot, first + slot, begin % packed.tiles);
    });
    parallelFor(heads * query_tiles, 1, [&](size_t begin, size_t) {
      throwIfCancelled();
      const size_t slot = begin / query_tiles;
      const size_t query = begin % query_tiles * tile_queries;
      attendTile(packed, work, slot, first + slot, query,
                 std::min(tile_queries, shape.queries - query));
    });
  }
}

}  // namespace stipple
