#include "nn/training/attention_backward.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/kernels/layer_kernel.h"
#include "nn/matmul.h"
#include "nn/scratch.h"

namespace stipple {

namespace {

/// Queries of a tile.
constexpr size_t kTile = 128;

/// [width, keys] from the rows of a head.
void turnHead(const HeadRows& rows, size_t head_first, size_t keys, size_t width, float* out) {
  for (size_t key = 0; key < keys; ++key) {
    const float* from = rows.values + key * rows.row_stride + head_first;
    for (size_t i = 0; i < width; ++i) out[i * keys + key] = from[i];
  }
}

/// to += from, [rows, width] each.
void addRows(size_t rows, size_t width, const float* from, HeadGradients to, size_t first) {
  for (size_t row = 0; row < rows; ++row) {
    float* into = to.values + row * to.row_stride + first;
    for (size_t i = 0; i < width; ++i) into[i] += from[row * width + i];
  }
}

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
  Scratch room(2 * keys * width + keys * width + 2 * kTile * keys);
  float* turned_keys = room.data();
  float* turned_values = turned_keys + keys * width;
  float* made = turned_values + keys * width;
  float* shares = made + keys * width;
  float* inner = shares + kTile * keys;
  turnHead(work.k, first, keys, width, turned_keys);
  turnHead(work.v, first, keys, width, turned_values);
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
    multiply({count, width, keys}, queries, {turned_keys, keys}, {shares, keys});
    shareOut(count, keys, work.scale, shares);
    multiply({keys, count, width}, {shares, 1, keys}, outer, {made, width});
    addRows(keys, width, made, work.v_gradient, first);
    multiply({count, width, keys}, outer, {turned_values, keys}, {inner, keys});
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
    multiply({count, keys, width}, {inner, keys}, {work.k.values + first, work.k.row_stride},
             {work.q_gradient.values + begin * work.q_gradient.row_stride + first,
              work.q_gradient.row_stride});
    multiply({keys, count, width}, {inner, 1, keys}, queries, {made, width});
    addRows(keys, width, made, work.k_gradient, first);
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
