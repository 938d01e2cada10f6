#include "nn/training/attention_backward.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/scratch.h"
#include "nn/training/packed_product.h"

namespace stipple {

namespace {

/// Queries of a tile.
constexpr size_t kTile = 128;

struct HeadWork {
  const AttentionShape& shape;
  HeadRows q, k, v, out, out_gradient;
  HeadGradients q_gradient, k_gradient, v_gradient;
  float scale;
};

/// Rows of scores become shares of the keys.
void shareOut(size_t count, size_t keys, float scale, float* scores) {
  const LayerKernel& layer = chosenLayerKernel();
  for (size_t i = 0; i < count; ++i) {
    SoftmaxRow row;
    row.scores = scores + i * keys;
    row.keys = keys;
    row.scale = scale;
    row.peak = std::numeric_limits<float>::lowest();
    layer.softmax(row);
    const float factor = 1.0f / row.sum;
    for (size_t key = 0; key < keys; ++key) row.scores[key] *= factor;
  }
}

void backwardOfHead(const HeadWork& work, size_t head) {
  const size_t width = work.shape.head_width, keys = work.shape.keys, first = head * width;
  Scratch room(2 * kTile * keys);
  float* shares = room.data();
  float* inner = shares + kTile * keys;
  const MatrixView all_keys = {work.k.values + first, work.k.row_stride};
  const PackedMatrix keys_turned(width, keys, {all_keys.values, 1, all_keys.row_stride});
  const PackedMatrix values_turned(width, keys, {work.v.values + first, 1, work.v.row_stride});
  const PackedMatrix packed_keys(keys, width, all_keys);
  const auto columnsOf = [&](const HeadGradients& of) {
    return RowMatrix{of.values + first, of.row_stride};
  };
  for (size_t key = 0; key < keys; ++key) {
    std::fill_n(work.k_gradient.values + key * work.k_gradient.row_stride + first, width, 0.0f);
    std::fill_n(work.v_gradient.values + key * work.v_gradient.row_stride + first, width, 0.0f);
  }
  for (size_t begin = 0; begin < work.shape.queries; begin += kTile) {
    const size_t count = std::min(kTile, work.shape.queries - begin);
    const auto rowsOf = [&](const HeadRows& rows) {
      return MatrixView{rows.values + begin * rows.row_stride + first, rows.row_stride};
    };
    const MatrixView queries = rowsOf(work.q), outer = rowsOf(work.out_gradient);
    keys_turned.multiply(count, queries, {shares, keys});
    shareOut(count, keys, work.scale, shares);
    PackedMatrix(count, width, outer).add(keys, {shares, 1, keys}, columnsOf(work.v_gradient));
    values_turned.multiply(count, outer, {inner, keys});
    const MatrixView results = rowsOf(work.out);
    for (size_t i = 0; i < count; ++i) {
      float along = 0;
      for (size_t c = 0; c < width; ++c) {
        along +=
            outer.values[i * outer.row_stride + c] * results.values[i * results.row_stride + c];
      }
      for (size_t key = 0; key < keys; ++key) {
        float& value = inner[i * keys + key];
        value = work.scale * shares[i * keys + key] * (value - along);
      }
    }
    packed_keys.multiply(count, {inner, keys},
                         {work.q_gradient.values + begin * work.q_gradient.row_stride + first,
                          work.q_gradient.row_stride});
    PackedMatrix(count, width, queries).add(keys, {inner, 1, keys}, columnsOf(work.k_gradient));
  }
}

}  // namespace

void attentionBackward(const AttentionShape& shape, HeadRows q, HeadRows k, HeadRows v,
                       HeadRows out, HeadRows out_gradient, HeadGradients q_gradient,
                       HeadGradients k_gradient, HeadGradients v_gradient) {
  if (shape.keys == 0) fail(ErrorCode::kInvalidArgument, "an attention has 0 keys; 1 is needed");
  const HeadWork work = {shape,      q,
                         k,          v,
                         out,        out_gradient,
                         q_gradient, k_gradient,
                         v_gradient, 1.0f / std::sqrt(static_cast<float>(shape.head_width))};
  parallelFor(shape.heads, 1, [&](size_t head, size_t) { backwardOfHead(work, head); });
}

}  // namespace stipple
