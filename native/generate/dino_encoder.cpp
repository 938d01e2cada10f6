// Based on: O. Siméoni et al., DINOv3, arXiv 2508.10104, 2025; J. Su et al., RoFormer, arXiv
// 2104.09864 (positions). Differs: everything but the factors of products is float32.
#include "generate/dino_encoder.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/default_init_vector.h"
#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/attention.h"
#include "nn/norms.h"
#include "nn/positions.h"

namespace stipple {

namespace {

constexpr float kEpsilon = 1e-5f;
constexpr double kLongestPeriod = 100.0;
constexpr float kMean[3] = {0.485f, 0.456f, 0.406f};
constexpr float kDeviation[3] = {0.229f, 0.224f, 0.225f};

/// Where the layers' names begin: files of newer exporters have "model.layer.".
std::string layerPrefix(const WeightTable& weights) {
  return weights.countBlocks("layer.") == 0 ? "model.layer." : "layer.";
}

/// Tokens of the whole image: class token and registers.
std::vector<float> readPrefix(const WeightTable& weights, size_t width) {
  std::vector<float> prefix = weights.floats("embeddings.cls_token", {1, 1, width});
  const WeightTensor& tensor = weights.require("embeddings.register_tokens", {1, kAnySize, width});
  const std::vector<float> registers =
      weights.floats("embeddings.register_tokens", {1, tensor.shape[1], width});
  prefix.insert(prefix.end(), registers.begin(), registers.end());
  return prefix;
}

/// Angles of the patches: half of the pairs turn with the row, half with the column.
RotaryTable rotaryTable(size_t rows, size_t columns, size_t head_width) {
  const size_t quarter = head_width / 4;
  RotaryTable table;
  table.pairs = 2 * quarter;
  for (size_t patch = 0; patch < rows * columns; ++patch) {
    const double places[2] = {
        2.0 * (static_cast<double>(patch / columns) + 0.5) / static_cast<double>(rows) - 1.0,
        2.0 * (static_cast<double>(patch % columns) + 0.5) / static_cast<double>(columns) - 1.0};
    for (const double place : places) {
      for (size_t j = 0; j < quarter; ++j) {
        const double exponent = -4.0 * static_cast<double>(j) / static_cast<double>(head_width);
        const double angle = 2.0 * std::numbers::pi * place * std::pow(kLongestPeriod, exponent);
        table.cosines.push_back(static_cast<float>(std::cos(angle)));
        table.sines.push_back(static_cast<float>(std::sin(angle)));
      }
    }
  }
  return table;
}

}  // namespace

/// All that a run needs at a time. q, k and v lie in `wide`, and so do the MLP's two branches.
struct DinoEncoder::Buffers {
  size_t rows;
  RotaryTable positions;
  DefaultInitVector<float> tokens, normed, wide;

  Buffers(size_t row_count, size_t width, size_t inner_width, RotaryTable table)
      : rows(row_count), positions(std::move(table)) {
    tokens.resize(rows * width);
    normed.resize(rows * width);
    wide.resize(rows * std::max(3 * width, 2 * inner_width));
  }
};

DinoEncoder::DinoEncoder(const WeightTable& weights, const DinoOptions& options)
    : head_width_(options.head_width) {
  const WeightTensor& patches =
      weights.require("embeddings.patch_embeddings.weight", {kAnySize, 3, kAnySize, kAnySize});
  width_ = static_cast<size_t>(patches.shape[0]);
  patch_size_ = static_cast<size_t>(patches.shape[2]);
  if (head_width_ == 0 || head_width_ % 4 != 0 || width_ == 0 || width_ % head_width_ != 0) {
    fail(ErrorCode::kFormat, weights.source() + ": tokens have " + std::to_string(width_) +
                                 " numbers; heads of " + std::to_string(head_width_) +
                                 " need a multiple of that, and of 4.");
  }
  if (patch_size_ == 0 || patch_size_ > 64) {
    fail(ErrorCode::kFormat, weights.source() + ": patches have " + std::to_string(patch_size_) +
                                 " pixels a side; 1 to 64 are allowed.");
  }
  const ConvolutionGrid grid = {patch_size_, patch_size_, 0, 0};
  patches_ = Convolution(weights, "embeddings.patch_embeddings", 3, width_, grid);
  prefix_ = readPrefix(weights, width_);
  const std::string prefix = layerPrefix(weights);
  const size_t layer_count = weights.countBlocks(prefix);
  // Refuses a file without layers by the name of the first one's tensor.
  for (size_t i = 0; i < std::max<size_t>(layer_count, 1); ++i) {
    const std::string name = prefix + std::to_string(i) + ".";
    Layer layer;
    layer.norm1_weight = weights.floats(name + "norm1.weight", {width_});
    layer.norm1_bias = weights.floats(name + "norm1.bias", {width_});
    layer.norm2_weight = weights.floats(name + "norm2.weight", {width_});
    layer.norm2_bias = weights.floats(name + "norm2.bias", {width_});
    layer.scale1 = weights.floats(name + "layer_scale1.lambda1", {width_});
    layer.scale2 = weights.floats(name + "layer_scale2.lambda1", {width_});
    layer.query = Linear(weights, name + "attention.q_proj", width_, width_);
    layer.key = Linear(weights, name + "attention.k_proj", width_, width_, LinearBias::kNone);
    layer.value = Linear(weights, name + "attention.v_proj", width_, width_);
    layer.output = Linear(weights, name + "attention.o_proj", width_, width_);
    layer.gate = Linear(weights, name + "mlp.gate_proj", width_, i == 0 ? kAnySize : inner_width_);
    inner_width_ = layer.gate.outputs();
    layer.up = Linear(weights, name + "mlp.up_proj", width_, inner_width_);
    layer.down = Linear(weights, name + "mlp.down_proj", inner_width_, width_);
    layers_.push_back(std::move(layer));
  }
  norm_weight_ = weights.floats("norm.weight", {width_});
  norm_bias_ = weights.floats("norm.bias", {width_});
}

double DinoEncoder::flops(size_t height, size_t width) const {
  const auto rows = static_cast<double>(rowsFor(height, width));
  const auto wide = static_cast<double>(width_);
  const double linear = 2.0 * rows * wide * (4.0 * wide + 3.0 * static_cast<double>(inner_width_));
  const double attention = 4.0 * rows * rows * wide;
  return static_cast<double>(layers_.size()) * (linear + attention) + patches_.flops(height, width);
}

void DinoEncoder::attend(const NetworkRun& run, const Layer& layer, const std::string& name,
                         Buffers& buffers, const StageListener& listener) const {
  const size_t rows = buffers.rows;
  const size_t heads = width_ / head_width_;
  const auto say = [&](const char* stage, const float* values) {
    if (listener) listener(name + stage, {rows, width_, width_, values});
  };
  float* normed = buffers.normed.data();
  layerNorm({width_, kEpsilon, layer.norm1_weight, layer.norm1_bias, {}, {}}, rows,
            buffers.tokens.data(), normed);
  say("norm1", normed);
  float* q = buffers.wide.data();
  float* k = q + rows * width_;
  float* v = k + rows * width_;
  layer.query.apply(run, rows, normed, q);
  layer.key.apply(run, rows, normed, k);
  layer.value.apply(run, rows, normed, v);
  const size_t first_patch = prefixRows();
  for (float* values : {q, k}) {
    rotateHalves(buffers.positions, rows - first_patch, heads, head_width_,
                 values + first_patch * width_, width_);
  }
  say("q_rope", q);
  say("k_rope", k);
  const AttentionShape shape = {heads, head_width_, rows, rows};
  attention(run, shape, {q, width_}, {k, width_}, {v, width_}, q, width_);
  layer.output.apply(run, rows, q, normed);
  say("attn", normed);
  addScaled(rows, width_, layer.scale1, normed, buffers.tokens.data());
  say("after_attn", buffers.tokens.data());
}

void DinoEncoder::transform(const NetworkRun& run, const Layer& layer, const std::string& name,
                            Buffers& buffers, const StageListener& listener) const {
  const size_t rows = buffers.rows;
  const auto say = [&](const char* stage, const float* values) {
    if (listener) listener(name + stage, {rows, width_, width_, values});
  };
  float* normed = buffers.normed.data();
  layerNorm({width_, kEpsilon, layer.norm2_weight, layer.norm2_bias, {}, {}}, rows,
            buffers.tokens.data(), normed);
  say("norm2", normed);
  float* gate = buffers.wide.data();
  float* up = gate + rows * inner_width_;
  layer.gate.apply(run, rows, normed, gate);
  layer.up.apply(run, rows, normed, up);
  siluGate(rows * inner_width_, gate, up, gate);
  layer.down.apply(run, rows, gate, normed);
  say("mlp", normed);
  addScaled(rows, width_, layer.scale2, normed, buffers.tokens.data());
  say("out", buffers.tokens.data());
}

std::vector<float> DinoEncoder::encode(const NetworkRun& run, std::span<const float> rgb,
                                       size_t height, size_t width,
                                       const StageListener& listener) const {
  if (height == 0 || width == 0 || height % patch_size_ != 0 || width % patch_size_ != 0) {
    fail(ErrorCode::kInvalidArgument, "The image has " + sizeText(width, height) +
                                          " pixels; multiples of " + std::to_string(patch_size_) +
                                          " are allowed.");
  }
  if (rgb.size() != height * width * 3) {
    fail(ErrorCode::kInvalidArgument, "The image has " + std::to_string(rgb.size()) +
                                          " numbers; it needs " +
                                          std::to_string(height * width * 3) + ".");
  }
  requireFinite(rgb.data(), height * width, 3, "the image");
  const char* stage = "Features of the image";
  advance(run.progress, 0.0, stage);
  const size_t patch_rows = height / patch_size_, patch_columns = width / patch_size_;
  const size_t rows = rowsFor(height, width);
  Buffers buffers(rows, width_, inner_width_, rotaryTable(patch_rows, patch_columns, head_width_));
  {
    FeatureMap image = FeatureMap::ofSize(height, width, 3);
    for (size_t i = 0; i < rgb.size(); ++i) {
      image.values[i] = (rgb[i] - kMean[i % 3]) / kDeviation[i % 3];
    }
    const FeatureMap embedded = patches_.apply(run, image);
    if (listener) {
      listener("patch_embed", {embedded.pixelCount(), width_, width_, embedded.values.data()});
    }
    std::copy(prefix_.begin(), prefix_.end(), buffers.tokens.begin());
    std::copy(embedded.values.begin(), embedded.values.end(),
              buffers.tokens.begin() + static_cast<std::ptrdiff_t>(prefix_.size()));
  }
  if (listener) listener("tokens0", {rows, width_, width_, buffers.tokens.data()});
  const auto layer_count = static_cast<double>(layers_.size());
  for (size_t i = 0; i < layers_.size(); ++i) {
    const std::string name = "layer" + std::to_string(i) + ".";
    attend(run, layers_[i], name, buffers, listener);
    advance(run.progress, (static_cast<double>(i) + 0.5) / layer_count, stage);
    transform(run, layers_[i], name, buffers, listener);
    advance(run.progress, (static_cast<double>(i) + 1.0) / layer_count, stage);
  }
  std::vector<float> features(rows * width_);
  layerNorm({width_, kEpsilon, norm_weight_, norm_bias_, {}, {}}, rows, buffers.tokens.data(),
            features.data());
  if (listener) listener("norm", {rows, width_, width_, features.data()});
  layerNorm({width_, kEpsilon, {}, {}, {}, {}}, rows, features.data(), features.data());
  if (listener) listener("feature1", {rows, width_, width_, features.data()});
  return features;
}

}  // namespace stipple
