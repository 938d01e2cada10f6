// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), and its released networks: tokens
// with normalised queries and keys. Differs: derivatives are written out, layer by layer.
#include "train/networks/trained_layers.h"

#include <algorithm>

#include "base/parallel.h"
#include "nn/activations.h"
#include "nn/norms.h"
#include "nn/positions.h"
#include "nn/scratch.h"
#include "nn/training/attention_backward.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 1 << 14;

void addAll(std::span<const float> from, float* to) {
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) to[i] += from[i];
  });
}

}  // namespace

TrainedPointEmbedding::TrainedPointEmbedding(ParameterLayout& layout, const std::string& prefix,
                                             size_t width)
    : in_(layout, prefix + "in_proj", 3, width),
      out_(layout, prefix + "input_layer", width, width) {}

std::vector<float> TrainedPointEmbedding::inside(std::span<const float> values, size_t rows,
                                                 const float* points) const {
  std::vector<float> made(rows * in_.outputs());
  in_.apply(values, rows, points, made.data());
  addPositions(PositionEncoding::kGeometric, rows, in_.outputs(), points, made.data());
  return made;
}

void TrainedPointEmbedding::apply(std::span<const float> values, size_t rows, const float* points,
                                  float* tokens) const {
  const std::vector<float> made = inside(values, rows, points);
  out_.apply(values, rows, made.data(), tokens);
}

void TrainedPointEmbedding::backward(std::span<const float> values, size_t rows,
                                     const float* points, const float* gradient,
                                     std::span<float> gradients) const {
  const std::vector<float> made = inside(values, rows, points);
  std::vector<float> by_made(made.size());
  out_.backward(values, rows, made.data(), gradient, gradients, by_made.data());
  in_.backward(values, rows, points, by_made.data(), gradients, nullptr);
}

TrainedCrossAttention::TrainedCrossAttention(ParameterLayout& layout, const std::string& prefix,
                                             const NetworkShape& shape)
    : shape_(shape),
      to_queries_(layout, prefix + "to_q", shape.width(), shape.width(), LinearBias::kNeeded,
                  layout.precision()),
      to_latent_(layout, prefix + "to_kv", shape.latent_width, 2 * shape.width(),
                 LinearBias::kNeeded, layout.precision()),
      query_gamma_(layout.add(prefix + "q_rms_norm.gamma", {shape.heads, shape.head_width})),
      key_gamma_(layout.add(prefix + "k_rms_norm.gamma", {shape.heads, shape.head_width})),
      to_out_(layout, prefix + "to_out", shape.width(), shape.width(), LinearBias::kNeeded,
              layout.precision()) {}

LatentRows TrainedCrossAttention::look(std::span<const float> values, size_t tokens,
                                       const float* latent) const {
  const size_t width = shape_.width();
  LatentRows rows;
  rows.made.resize(tokens * 2 * width);
  to_latent_.apply(values, tokens, latent, rows.made.data());
  rows.keys.resize(tokens * width);
  for (size_t token = 0; token < tokens; ++token) {
    std::copy_n(&rows.made[token * 2 * width], width, &rows.keys[token * width]);
  }
  rmsNormHeads(tokens, shape_.heads, shape_.head_width, gammaOf(values, key_gamma_),
               rows.keys.data(), width);
  return rows;
}

void TrainedCrossAttention::apply(std::span<const float> values, size_t rows, const float* in,
                                  const LatentRows& latent, Tape& tape, float* out) const {
  const size_t width = shape_.width(), tokens = latent.keys.size() / width;
  tape.made.resize(rows * width);
  tape.attended.resize(rows * width);
  to_queries_.apply(values, rows, in, tape.made.data());
  tape.queries = tape.made;
  rmsNormHeads(rows, shape_.heads, shape_.head_width, gammaOf(values, query_gamma_),
               tape.queries.data(), width);
  attention({}, {shape_.heads, shape_.head_width, rows, tokens}, {tape.queries.data(), width},
            {latent.keys.data(), width}, {latent.made.data() + width, 2 * width},
            tape.attended.data(), width);
  to_out_.apply(values, rows, tape.attended.data(), out);
}

void TrainedCrossAttention::backward(std::span<const float> values, size_t rows, const float* in,
                                     const Tape& tape, const float* out_gradient,
                                     LatentRows& latent, std::span<float> gradients,
                                     float* in_gradient) const {
  const size_t width = shape_.width(), tokens = latent.keys.size() / width;
  std::vector<float> by_attended(rows * width), by_queries(rows * width);
  // Rows that nobody has looked back at take the derivatives as they are made.
  const bool is_first = latent.gradient.empty();
  if (is_first) latent.gradient.resize(latent.made.size());
  Scratch more(is_first ? 0 : latent.made.size());
  float* const by_latent = is_first ? latent.gradient.data() : more.data();
  to_out_.backward(values, rows, tape.attended.data(), out_gradient, gradients, by_attended.data());
  attentionBackward({shape_.heads, shape_.head_width, rows, tokens}, {tape.queries.data(), width},
                    {latent.keys.data(), width}, {latent.made.data() + width, 2 * width},
                    {tape.attended.data(), width}, {by_attended.data(), width},
                    {by_queries.data(), width}, {by_latent, 2 * width},
                    {by_latent + width, 2 * width});
  if (!is_first) addAll({by_latent, latent.made.size()}, latent.gradient.data());
  rmsNormHeadsBackward(rows, shape_.heads, shape_.head_width, gammaOf(values, query_gamma_),
                       tape.made.data(), width, by_queries.data(), width,
                       gradients.data() + query_gamma_);
  to_queries_.backward(values, rows, in, by_queries.data(), gradients, in_gradient);
}

void TrainedCrossAttention::backwardOfLatent(std::span<const float> values, size_t tokens,
                                             const float* latent, LatentRows& rows,
                                             std::span<float> gradients,
                                             float* latent_gradient) const {
  if (rows.gradient.empty()) return;
  const size_t width = shape_.width(), count = tokens * shape_.latent_width;
  rmsNormHeadsBackward(tokens, shape_.heads, shape_.head_width, gammaOf(values, key_gamma_),
                       rows.made.data(), 2 * width, rows.gradient.data(), 2 * width,
                       gradients.data() + key_gamma_);
  Scratch by_latent(count);
  to_latent_.backward(values, tokens, latent, rows.gradient.data(), gradients, by_latent.data());
  addAll({by_latent.data(), count}, latent_gradient);
}

TrainedSelfAttention::TrainedSelfAttention(ParameterLayout& layout, const std::string& prefix,
                                           const NetworkShape& shape)
    : shape_(shape),
      to_all_(layout, prefix + "to_qkv", shape.width(), 3 * shape.width(), LinearBias::kNeeded,
              layout.precision()),
      query_gamma_(layout.add(prefix + "q_rms_norm.gamma", {shape.heads, shape.head_width})),
      key_gamma_(layout.add(prefix + "k_rms_norm.gamma", {shape.heads, shape.head_width})),
      to_out_(layout, prefix + "to_out", shape.width(), shape.width(), LinearBias::kNeeded,
              layout.precision()) {}

void TrainedSelfAttention::apply(std::span<const float> values, size_t rows, const float* in,
                                 Tape& tape, float* out) const {
  const size_t width = shape_.width(), stride = 3 * width;
  tape.made.resize(rows * stride);
  tape.attended.resize(rows * width);
  to_all_.apply(values, rows, in, tape.made.data());
  tape.normal = tape.made;
  float* normal = tape.normal.data();
  rmsNormHeads(rows, shape_.heads, shape_.head_width, values.subspan(query_gamma_, width), normal,
               stride);
  rmsNormHeads(rows, shape_.heads, shape_.head_width, values.subspan(key_gamma_, width),
               normal + width, stride);
  attention({}, {shape_.heads, shape_.head_width, rows, rows}, {normal, stride},
            {normal + width, stride}, {normal + 2 * width, stride}, tape.attended.data(), width);
  to_out_.apply(values, rows, tape.attended.data(), out);
}

void TrainedSelfAttention::backward(std::span<const float> values, size_t rows, const float* in,
                                    const Tape& tape, const float* out_gradient,
                                    std::span<float> gradients, float* in_gradient) const {
  const size_t width = shape_.width(), stride = 3 * width;
  std::vector<float> by_attended(rows * width), by_all(rows * stride);
  to_out_.backward(values, rows, tape.attended.data(), out_gradient, gradients, by_attended.data());
  const float* normal = tape.normal.data();
  attentionBackward({shape_.heads, shape_.head_width, rows, rows}, {normal, stride},
                    {normal + width, stride}, {normal + 2 * width, stride},
                    {tape.attended.data(), width}, {by_attended.data(), width},
                    {by_all.data(), stride}, {by_all.data() + width, stride},
                    {by_all.data() + 2 * width, stride});
  rmsNormHeadsBackward(rows, shape_.heads, shape_.head_width, values.subspan(query_gamma_, width),
                       tape.made.data(), stride, by_all.data(), stride,
                       gradients.data() + query_gamma_);
  rmsNormHeadsBackward(rows, shape_.heads, shape_.head_width, values.subspan(key_gamma_, width),
                       tape.made.data() + width, stride, by_all.data() + width, stride,
                       gradients.data() + key_gamma_);
  to_all_.backward(values, rows, in, by_all.data(), gradients, in_gradient);
}

TrainedMlp trainedTokenMlp(ParameterLayout& layout, const std::string& prefix,
                           const NetworkShape& shape) {
  const size_t width = shape.width();
  return {layout,
          prefix + "0",
          prefix + "2",
          {width, shape.mlp_ratio * width, width},
          Activation::kGeluTanh,
          layout.precision()};
}

}  // namespace stipple
