// Based on: Nam et al., Generative Densification, CVPR 2025, and its released code; the blocks are
// those of Wu et al., Point Transformer V3, CVPR 2024.
#include "decode/detail/detail_block.h"

#include <algorithm>

#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/attention.h"
#include "nn/norms.h"
#include "nn/training/attention_backward.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

/// Rows of `from` in an order.
std::vector<float> inOrder(std::span<const uint32_t> order, size_t width,
                           const std::vector<float>& from) {
  std::vector<float> made(from.size());
  for (size_t i = 0; i < order.size(); ++i) {
    std::copy_n(&from[order[i] * width], width, &made[i * width]);
  }
  return made;
}

/// The way back.
std::vector<float> outOfOrder(std::span<const uint32_t> order, size_t width,
                              const std::vector<float>& from) {
  std::vector<float> made(from.size());
  for (size_t i = 0; i < order.size(); ++i) {
    std::copy_n(&from[i * width], width, &made[order[i] * width]);
  }
  return made;
}

}  // namespace

PointNeighbourhood::PointNeighbourhood(std::span<const float> points, double side)
    : PointNeighbourhood(cellsOf(points, side)) {}

PointNeighbourhood::PointNeighbourhood(const PointCells& cells) : neighbours(cells) {
  for (size_t curve = 0; curve < kCellCurves; ++curve) {
    orders.push_back(cells.orderAlong(static_cast<CellCurve>(curve)));
  }
}

/// What is inside a block, of one run. Rows in order are those of the curve.
struct DetailBlock::Inside {
  std::vector<float> convolved, after;       // [points, channels]
  std::vector<float> placed;                 // f and the normalised of that
  std::vector<float> before_attention;       // normalised
  std::vector<float> qkv, attended;          // in order
  std::vector<float> attended_back, looked;  // as points are
  std::vector<float> before_mlp, passed;
  TrainedMlp::Tape mlp;
};

DetailBlock::DetailBlock(ParameterLayout& layout, const std::string& prefix,
                         const DetailBlockSizes& sizes)
    : sizes_(sizes),
      around_(layout, prefix + "cpe.0", sizes.channels, sizes.channels),
      after_(layout, prefix + "cpe.1", sizes.channels, sizes.channels, LinearBias::kNeeded,
             layout.precision()),
      to_all_(layout, prefix + "attn.qkv", sizes.channels, 3 * sizes.channels, LinearBias::kNeeded,
              layout.precision()),
      out_(layout, prefix + "attn.proj", sizes.channels, sizes.channels, LinearBias::kNeeded,
           layout.precision()),
      mlp_(layout, prefix + "mlp.0.fc1", prefix + "mlp.0.fc2",
           {sizes.channels, sizes.mlp_ratio * sizes.channels, sizes.channels}, Activation::kGeluErf,
           layout.precision()) {}

std::vector<DetailBlock::Patch> DetailBlock::patchesOf(size_t points) const {
  std::vector<Patch> patches;
  for (size_t first = 0; first < points; first += sizes_.patch) {
    const size_t count = std::min(sizes_.patch, points - first);
    const size_t keys = std::min(sizes_.patch, first + count);
    patches.push_back({first, count, first + count - keys, keys});
  }
  return patches;
}

std::vector<float> DetailBlock::run(std::span<const float> values, const PointNeighbourhood& around,
                                    size_t curve, const std::vector<float>& f,
                                    Inside& inside) const {
  const size_t channels = sizes_.channels, points = f.size() / channels, stride = 3 * channels;
  const LayerNorm norm = {channels, kDetailEpsilon, {}, {}, {}, {}};
  inside.convolved.resize(f.size());
  inside.after.resize(f.size());
  around_.apply(values, around.neighbours, f.data(), inside.convolved.data());
  after_.apply(values, points, inside.convolved.data(), inside.after.data());
  std::vector<float> normal(f.size());
  layerNorm(norm, points, inside.after.data(), normal.data());
  inside.placed = f;
  addScaled(points, channels, {}, normal.data(), inside.placed.data());

  inside.before_attention.resize(f.size());
  layerNorm(norm, points, inside.placed.data(), inside.before_attention.data());
  const std::vector<float> ordered =
      inOrder(around.orders[curve], channels, inside.before_attention);
  inside.qkv.resize(points * stride);
  to_all_.apply(values, points, ordered.data(), inside.qkv.data());
  inside.attended.resize(f.size());
  const std::vector<Patch> patches = patchesOf(points);
  parallelFor(patches.size(), 1, [&](size_t at, size_t) {
    const Patch& patch = patches[at];
    const float* queries = &inside.qkv[patch.first * stride];
    const float* keys = &inside.qkv[patch.first_key * stride];
    attention({}, {sizes_.heads, channels / sizes_.heads, patch.count, patch.key_count},
              {queries, stride}, {keys + channels, stride}, {keys + 2 * channels, stride},
              &inside.attended[patch.first * channels], channels);
  });
  inside.attended_back = outOfOrder(around.orders[curve], channels, inside.attended);
  inside.looked = inside.placed;
  std::vector<float> made(f.size());
  out_.apply(values, points, inside.attended_back.data(), made.data());
  addScaled(points, channels, {}, made.data(), inside.looked.data());

  inside.before_mlp.resize(f.size());
  layerNorm(norm, points, inside.looked.data(), inside.before_mlp.data());
  inside.passed.resize(f.size());
  mlp_.apply(values, points, inside.before_mlp.data(), inside.mlp, inside.passed.data());
  std::vector<float> result = inside.looked;
  addScaled(points, channels, {}, inside.passed.data(), result.data());
  return result;
}

std::vector<float> DetailBlock::apply(std::span<const float> values,
                                      const PointNeighbourhood& around, size_t curve,
                                      const std::vector<float>& f) const {
  Inside inside;
  return run(values, around, curve, f, inside);
}

void DetailBlock::backwardOfPatches(const std::vector<float>& qkv,
                                    const std::vector<float>& attended,
                                    const std::vector<float>& by_attended,
                                    std::vector<float>& by_qkv) const {
  const size_t channels = sizes_.channels, stride = 3 * channels;
  const std::vector<Patch> patches = patchesOf(attended.size() / channels);
  // Rows of keys that the last two patches share get the derivatives of both, one after the other.
  std::vector<std::vector<float>> by_keys(patches.size());
  parallelFor(patches.size(), 1, [&](size_t at, size_t) {
    const Patch& patch = patches[at];
    const float* queries = &qkv[patch.first * stride];
    const float* keys = &qkv[patch.first_key * stride];
    by_keys[at].resize(patch.key_count * 2 * channels);
    float* by = by_keys[at].data();
    attentionBackward({sizes_.heads, channels / sizes_.heads, patch.count, patch.key_count},
                      {queries, stride}, {keys + channels, stride}, {keys + 2 * channels, stride},
                      {&attended[patch.first * channels], channels},
                      {&by_attended[patch.first * channels], channels},
                      {&by_qkv[patch.first * stride], stride}, {by, 2 * channels},
                      {by + channels, 2 * channels});
  });
  for (size_t at = 0; at < patches.size(); ++at) {
    for (size_t key = 0; key < patches[at].key_count; ++key) {
      float* to = &by_qkv[(patches[at].first_key + key) * stride + channels];
      for (size_t i = 0; i < 2 * channels; ++i) to[i] += by_keys[at][key * 2 * channels + i];
    }
  }
}

void DetailBlock::backward(std::span<const float> values, const PointNeighbourhood& around,
                           size_t curve, const std::vector<float>& f, std::vector<float>& by_f,
                           std::span<float> gradients) const {
  const size_t channels = sizes_.channels, points = f.size() / channels;
  const LayerNorm norm = {channels, kDetailEpsilon, {}, {}, {}, {}};
  Inside inside;
  run(values, around, curve, f, inside);
  std::vector<float> by_normal(f.size());
  mlp_.backward(values, points, inside.before_mlp.data(), inside.mlp, by_f.data(), gradients,
                by_normal.data());
  layerNormBackward(norm, points, inside.looked.data(), by_normal.data(), {}, by_f.data());

  std::vector<float> by_back(f.size()), by_qkv(3 * f.size(), 0.0f), by_ordered(f.size());
  out_.backward(values, points, inside.attended_back.data(), by_f.data(), gradients,
                by_back.data());
  const std::vector<uint32_t>& order = around.orders[curve];
  backwardOfPatches(inside.qkv, inside.attended, inOrder(order, channels, by_back), by_qkv);
  const std::vector<float> ordered = inOrder(order, channels, inside.before_attention);
  to_all_.backward(values, points, ordered.data(), by_qkv.data(), gradients, by_ordered.data());
  by_normal = outOfOrder(order, channels, by_ordered);
  layerNormBackward(norm, points, inside.placed.data(), by_normal.data(), {}, by_f.data());

  std::vector<float> by_after(f.size(), 0.0f), by_convolved(f.size());
  layerNormBackward(norm, points, inside.after.data(), by_f.data(), {}, by_after.data());
  after_.backward(values, points, inside.convolved.data(), by_after.data(), gradients,
                  by_convolved.data());
  around_.backward(values, around.neighbours, f.data(), by_convolved.data(), gradients,
                   by_f.data());
}

}  // namespace stipple
