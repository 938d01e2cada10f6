// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), blocks of its encoder and attribute
// decoder.
#include "train/networks/trained_block.h"

#include <utility>

#include "decode/latent/token_layers.h"
#include "nn/activations.h"
#include "nn/training/norms_backward.h"

namespace stipple {

TrainedTokenBlock::TrainedTokenBlock(ParameterLayout& layout, const std::string& prefix,
                                     const NetworkShape& shape, size_t contexts)
    : width_(shape.width()),
      self_(layout, prefix + "self_attn.", shape),
      mlp_(trainedTokenMlp(layout, prefix + "mlp.mlp.", shape)) {
  for (size_t i = 0; i < contexts; ++i) {
    const std::string norm = prefix + (i == 0 ? "norm2" : "norm2_1");
    const std::string attention = prefix + (i == 0 ? "cross_attn." : "cross_attn2.");
    const size_t weight = layout.add(norm + ".weight", {width_});
    const size_t bias = layout.add(norm + ".bias", {width_});
    looks_.push_back({weight, bias, TrainedCrossAttention(layout, attention, shape)});
  }
}

LayerNorm TrainedTokenBlock::normOf(std::span<const float> values, const Look& look) const {
  return {width_,
          kTokenEpsilon,
          values.subspan(look.weight, width_),
          values.subspan(look.bias, width_),
          {},
          {}};
}

std::vector<LatentRows> TrainedTokenBlock::look(std::span<const float> values,
                                                std::span<const ContextRows> contexts) const {
  std::vector<LatentRows> seen;
  for (size_t i = 0; i < looks_.size(); ++i) {
    seen.push_back(looks_[i].attention.look(values, contexts[i].count, contexts[i].values));
  }
  return seen;
}

std::vector<float> TrainedTokenBlock::run(std::span<const float> values,
                                          std::span<const LatentRows> seen,
                                          const std::vector<float>& tokens, Inside& inside) const {
  const size_t rows = tokens.size() / width_;
  const LayerNorm plain = {width_, kTokenEpsilon, {}, {}, {}, {}};
  std::vector<float> now = tokens, made(tokens.size());
  inside.looks.resize(looks_.size());
  const auto part = [&](const LayerNorm& norm, const auto& apply) {
    std::vector<float> normal(now.size());
    layerNorm(norm, rows, now.data(), normal.data());
    apply(normal.data());
    inside.tokens.push_back(now);
    inside.normal.push_back(std::move(normal));
    addScaled(rows, width_, {}, made.data(), now.data());
  };
  part(plain, [&](const float* in) { self_.apply(values, rows, in, inside.self, made.data()); });
  for (size_t i = 0; i < looks_.size(); ++i) {
    part(normOf(values, looks_[i]), [&](const float* in) {
      looks_[i].attention.apply(values, rows, in, seen[i], inside.looks[i], made.data());
    });
  }
  part(plain, [&](const float* in) { mlp_.apply(values, rows, in, inside.mlp, made.data()); });
  return now;
}

std::vector<float> TrainedTokenBlock::apply(std::span<const float> values,
                                            std::span<const LatentRows> seen,
                                            const std::vector<float>& tokens) const {
  Inside inside;
  return run(values, seen, tokens, inside);
}

void TrainedTokenBlock::backward(std::span<const float> values, std::span<LatentRows> seen,
                                 const std::vector<float>& tokens, std::vector<float>& by_tokens,
                                 std::span<float> gradients) const {
  const size_t rows = tokens.size() / width_;
  const LayerNorm plain = {width_, kTokenEpsilon, {}, {}, {}, {}};
  Inside inside;
  run(values, seen, tokens, inside);
  std::vector<float> by_normal(tokens.size());
  size_t at = inside.tokens.size();
  const auto part = [&](const LayerNorm& norm, const LayerNormGradients& of_norm,
                        const auto& backward) {
    --at;
    backward(inside.normal[at].data());
    layerNormBackward(norm, rows, inside.tokens[at].data(), by_normal.data(), of_norm,
                      by_tokens.data());
  };
  part(plain, {}, [&](const float* in) {
    mlp_.backward(values, rows, in, inside.mlp, by_tokens.data(), gradients, by_normal.data());
  });
  for (size_t i = looks_.size(); i-- > 0;) {
    const LayerNormGradients of_norm = {&gradients[looks_[i].weight], &gradients[looks_[i].bias],
                                        nullptr, nullptr};
    part(normOf(values, looks_[i]), of_norm, [&](const float* in) {
      looks_[i].attention.backward(values, rows, in, inside.looks[i], by_tokens.data(), seen[i],
                                   gradients, by_normal.data());
    });
  }
  part(plain, {}, [&](const float* in) {
    self_.backward(values, rows, in, inside.self, by_tokens.data(), gradients, by_normal.data());
  });
}

void TrainedTokenBlock::backwardOfContexts(std::span<const float> values,
                                           std::span<const ContextRows> contexts,
                                           std::span<LatentRows> seen, std::span<float> gradients,
                                           std::span<float* const> by_contexts) const {
  for (size_t i = 0; i < looks_.size(); ++i) {
    looks_[i].attention.backwardOfLatent(values, contexts[i].count, contexts[i].values, seen[i],
                                         gradients, by_contexts[i]);
  }
}

TrainedTokenStack::TrainedTokenStack(ParameterLayout& layout, const std::string& prefix,
                                     const NetworkShape& shape, size_t contexts) {
  for (size_t i = 0; i < shape.block_count; ++i) {
    blocks_.emplace_back(layout, prefix + "blocks." + std::to_string(i) + ".", shape, contexts);
  }
}

const std::vector<float>& TrainedTokenStack::apply(std::span<const float> values,
                                                   std::span<const ContextRows> contexts,
                                                   std::vector<float> tokens, Tape& tape) const {
  tape.tokens.clear();
  tape.seen.clear();
  tape.tokens.push_back(std::move(tokens));
  for (const TrainedTokenBlock& block : blocks_) {
    tape.seen.push_back(block.look(values, contexts));
    tape.tokens.push_back(block.apply(values, tape.seen.back(), tape.tokens.back()));
  }
  return tape.tokens.back();
}

void TrainedTokenStack::backward(std::span<const float> values,
                                 std::span<const ContextRows> contexts, Tape& tape,
                                 std::vector<float>& by_tokens, std::span<float> gradients,
                                 std::span<float* const> by_contexts) const {
  for (size_t i = blocks_.size(); i-- > 0;) {
    blocks_[i].backward(values, tape.seen[i], tape.tokens[i], by_tokens, gradients);
    blocks_[i].backwardOfContexts(values, contexts, tape.seen[i], gradients, by_contexts);
  }
}

}  // namespace stipple
