// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), and its released networks: tokens
// with normalised queries and keys. Layouts of to_qkv (3, heads, width) and to_kv (2, heads, width)
// are those of the published files.
#include "decode/latent/token_layers.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/attention.h"
#include "nn/positions.h"

namespace stipple {

namespace {

/// The encoding of positions needs two frequencies for the sine and the cosine of three axes.
constexpr size_t kLeastWidth = 12;

std::vector<float> readGamma(const WeightTable& weights, const char* name,
                             const TokenHeads& heads) {
  return weights.floats(name, {heads.count, heads.width});
}

/// Tokens whose keys are made at a time, and of a task among them.
constexpr size_t kKeyRows = 1024;
constexpr size_t kKeyGrain = 16;

/// As rmsNormHeads() has it.
float inverseLength(size_t count, const float* values) {
  double squares = 0;
  for (size_t i = 0; i < count; ++i) {
    squares += static_cast<double>(values[i]) * static_cast<double>(values[i]);
  }
  return static_cast<float>(1.0 / std::max(std::sqrt(squares), 1e-12));
}

}  // namespace

LayerNorm lastTokenNorm(size_t width) {
  constexpr float kLastEpsilon = 1e-5f;
  return {width, kLastEpsilon, {}, {}, {}, {}};
}

TokenHeads readTokenHeads(const WeightTable& network) {
  constexpr char kGamma[] = "blocks.0.cross_attn.q_rms_norm.gamma";
  const std::vector<uint64_t>& shape = network.require(kGamma, {kAnySize, kAnySize}).shape;
  const TokenHeads heads = {shape[0], shape[1]};
  if (heads.tokenWidth() < kLeastWidth) {
    fail(ErrorCode::kFormat, network.source() + ": " + kGamma + " says that there are " +
                                 std::to_string(heads.count) + " heads of " +
                                 std::to_string(heads.width) + " numbers; at least " +
                                 std::to_string(kLeastWidth) + " numbers in all are needed");
  }
  return heads;
}

void requireLatent(const Latent& latent, size_t width) {
  if (latent.width != width) {
    fail(ErrorCode::kInvalidArgument, "the latent has " + std::to_string(latent.width) +
                                          " numbers for each token; these weights read " +
                                          std::to_string(width));
  }
  if (latent.token_count == 0 || latent.tokens.size() / width != latent.token_count ||
      latent.tokens.size() % width != 0) {
    fail(ErrorCode::kInvalidArgument,
         "the latent has " + std::to_string(latent.tokens.size()) + " numbers for " +
             std::to_string(latent.token_count) + " tokens of " + std::to_string(width) +
             "; one token or more, and as many numbers as they have, are needed");
  }
  requireFinite(latent.tokens.data(), latent.tokens.size(), width, "the latent's token");
}

PointEmbedding::PointEmbedding(const WeightTable& network, size_t width)
    : in_(network, "in_proj", 3, width), out_(network, "input_layer", width, width) {}

void PointEmbedding::apply(const NetworkRun& run, size_t rows, const float* points, float* scratch,
                           float* tokens) const {
  in_.apply(run, rows, points, scratch);
  addPositions(PositionEncoding::kGeometric, rows, in_.outputs(), points, scratch);
  out_.apply(run, rows, scratch, tokens);
}

uint64_t latentKeyBytes(uint64_t token_count, size_t latent_width, size_t blocks,
                        const TokenHeads& heads) {
  const uint64_t made = std::min<uint64_t>(token_count, kKeyRows) * 2 * heads.tokenWidth();
  return SharedRows::bytes(token_count, latent_width) +
         (blocks * heads.count * token_count + made) * sizeof(float);
}

CrossAttention::CrossAttention(const WeightTable& weights, const TokenHeads& heads)
    : heads_(heads),
      to_queries_(weights, "to_q", heads.tokenWidth(), heads.tokenWidth()),
      to_keys_(weights, "to_kv", kAnySize, 2 * heads.tokenWidth()),
      to_out_(weights, "to_out", heads.tokenWidth(), heads.tokenWidth()),
      query_gamma_(readGamma(weights, "q_rms_norm.gamma", heads)) {
  const size_t inputs = latentWidth(), mapped = inputs + 1, width = heads_.tokenWidth();
  const std::vector<float> weight = weights.floats("to_kv.weight", {2 * width, inputs});
  const std::vector<float> bias = weights.floats("to_kv.bias", {2 * width});
  const std::vector<float> gamma = readGamma(weights, "k_rms_norm.gamma", heads_);
  key_maps_.resize(width * mapped);
  value_maps_.resize(width * mapped);
  for (size_t output = 0; output < width; ++output) {
    const size_t head = output / heads_.width, i = output % heads_.width;
    float* key = &key_maps_[head * mapped * heads_.width + i];
    float* value = &value_maps_[output * mapped];
    for (size_t k = 0; k < inputs; ++k) {
      key[k * heads_.width] = gamma[output] * weight[output * inputs + k];
      value[k] = weight[(width + output) * inputs + k];
    }
    key[inputs * heads_.width] = gamma[output] * bias[output];
    value[inputs] = bias[width + output];
  }
}

std::vector<float> CrossAttention::ratesOf(const NetworkRun& run, const Latent& latent) const {
  const size_t stride = to_keys_.outputs();
  const size_t most = std::min<uint64_t>(latent.token_count, kKeyRows);
  std::vector<float> keys(most * stride);
  std::vector<float> rates(heads_.count * latent.token_count);
  for (size_t first = 0; first < latent.token_count; first += most) {
    const size_t count = std::min<uint64_t>(most, latent.token_count - first);
    to_keys_.apply(run, count, latent.tokens.data() + first * latent.width, keys.data());
    parallelFor(count, kKeyGrain, [&](size_t begin, size_t end) {
      for (size_t row = begin; row < end; ++row) {
        for (size_t head = 0; head < heads_.count; ++head) {
          const float* key = &keys[row * stride + head * heads_.width];
          rates[head * latent.token_count + first + row] = inverseLength(heads_.width, key);
        }
      }
    });
  }
  return rates;
}

void CrossAttention::apply(const NetworkRun& run, size_t rows, const float* in,
                           const SharedRows& latent, std::span<const float> rates, float* scratch,
                           float* out) const {
  const size_t width = heads_.tokenWidth();
  to_queries_.apply(run, rows, in, scratch);
  // Of the length of gamma times the root of the width, as keys are, whose root the scale of
  // attention takes away again.
  rmsNormHeads(rows, heads_.count, heads_.width, query_gamma_, scratch, width);
  const SharedHeads heads = {heads_.count, heads_.width, key_maps_, value_maps_, rates};
  sharedAttention(run, heads, latent, rows, scratch, width, scratch);
  to_out_.apply(run, rows, scratch, out);
}

SelfAttention::SelfAttention(const WeightTable& weights, const TokenHeads& heads)
    : heads_(heads),
      to_all_(weights, "to_qkv", heads.tokenWidth(), 3 * heads.tokenWidth()),
      to_out_(weights, "to_out", heads.tokenWidth(), heads.tokenWidth()),
      query_gamma_(readGamma(weights, "q_rms_norm.gamma", heads)),
      key_gamma_(readGamma(weights, "k_rms_norm.gamma", heads)) {}

void SelfAttention::apply(const NetworkRun& run, size_t rows, const float* in, float* scratch,
                          float* out) const {
  const size_t width = heads_.tokenWidth();
  const size_t stride = 3 * width;
  to_all_.apply(run, rows, in, scratch);
  rmsNormHeads(rows, heads_.count, heads_.width, query_gamma_, scratch, stride);
  rmsNormHeads(rows, heads_.count, heads_.width, key_gamma_, scratch + width, stride);
  const AttentionShape shape = {heads_.count, heads_.width, rows, rows};
  attention(run, shape, {scratch, stride}, {scratch + width, stride}, {scratch + 2 * width, stride},
            scratch, stride);
  to_out_.apply(run, rows, scratch, stride, out, width);
}

TokenMlp::TokenMlp(const WeightTable& weights, size_t width)
    : up_(weights, "0", width, kAnySize), down_(weights, "2", up_.outputs(), width) {}

void TokenMlp::apply(const NetworkRun& run, size_t rows, const float* in, float* scratch,
                     float* out) const {
  up_.apply(run, rows, in, scratch);
  activate(Activation::kGeluTanh, {scratch, rows * up_.outputs()});
  down_.apply(run, rows, scratch, out);
}

}  // namespace stipple
