// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), density decoder, and the released
// network of that name.
#include "train/networks/trained_octree.h"

#include <cmath>
#include <numbers>

#include "decode/latent/octree_network.h"
#include "nn/activations.h"
#include "nn/norms.h"
#include "nn/positions.h"
#include "nn/training/norms_backward.h"

namespace stipple {

namespace {

constexpr size_t kChildren = 8;

std::vector<float> middlesOf(std::span<const OctreeLevel> levels) {
  std::vector<float> middles;
  for (const OctreeLevel& level : levels) {
    const std::vector<float> of = OctreeNetwork::centresOf(level.level, level.cells);
    middles.insert(middles.end(), of.begin(), of.end());
  }
  return middles;
}

}  // namespace

TrainedOctree::TrainedOctree(ParameterLayout& layout, const std::string& prefix,
                             const NetworkShape& shape)
    : shape_(shape),
      level_in_(layout, prefix + "l_embedder.mlp.0", OctreeNetwork::kLevelWidth, shape.width()),
      level_out_(layout, prefix + "l_embedder.mlp.2", shape.width(), shape.width()),
      modulation_(layout, prefix + "adaLN_modulation.1", shape.width(), 6 * shape.width()),
      embedding_(layout, prefix, shape.width()) {
  for (size_t i = 0; i < shape.block_count; ++i) {
    const std::string block = prefix + "blocks." + std::to_string(i) + ".";
    blocks_.push_back({TrainedCrossAttention(layout, block + "cross_attn.", shape),
                       trainedTokenMlp(layout, block + "mlp.mlp.", shape)});
  }
  out_ = TrainedLinear(layout, prefix + "out_proj", shape.width(), kChildren);
}

std::vector<TrainedOctree::Segment> TrainedOctree::segmentsOf(
    std::span<const float> values, std::span<const OctreeLevel> levels) const {
  const size_t width = shape_.width();
  std::vector<Segment> segments;
  size_t first = 0;
  for (const OctreeLevel& level : levels) {
    Segment segment;
    segment.first = first;
    segment.count = level.cells.size();
    first += segment.count;
    segment.encoding = OctreeNetwork::levelEncoding(level.level);
    segment.hidden.resize(width);
    segment.embedded.resize(width);
    segment.modulation.resize(6 * width);
    segment.gradient.assign(6 * width, 0.0f);
    level_in_.apply(values, 1, segment.encoding.data(), segment.hidden.data());
    segment.activated = segment.hidden;
    activate(Activation::kSilu, segment.activated);
    level_out_.apply(values, 1, segment.activated.data(), segment.embedded.data());
    segment.silu = segment.embedded;
    activate(Activation::kSilu, segment.silu);
    modulation_.apply(values, 1, segment.silu.data(), segment.modulation.data());
    segments.push_back(std::move(segment));
  }
  return segments;
}

std::vector<float> TrainedOctree::runBlock(std::span<const float> values, const Block& block,
                                           std::span<const Segment> segments,
                                           const LatentRows& latent,
                                           const std::vector<float>& tokens, Inside& inside) const {
  const size_t width = shape_.width(), rows = tokens.size() / width;
  // Of attention (which 0) or of the MLP (3): norm, then the gate onto the tokens.
  const auto part = [&](const Segment& segment, size_t which) {
    return std::span(segment.modulation).subspan(which * width, width);
  };
  const auto normalise = [&](size_t which, const std::vector<float>& from, std::vector<float>& to) {
    to.resize(from.size());
    for (const Segment& segment : segments) {
      const LayerNorm norm = {
          width, kTokenEpsilon, {}, {}, part(segment, which + 1), part(segment, which)};
      layerNorm(norm, segment.count, &from[segment.first * width], &to[segment.first * width]);
    }
  };
  const auto addGated = [&](size_t which, const std::vector<float>& from, std::vector<float>& to) {
    for (const Segment& segment : segments) {
      addScaled(segment.count, width, part(segment, which + 2), &from[segment.first * width],
                &to[segment.first * width]);
    }
  };
  normalise(0, tokens, inside.before_attention);
  inside.looked.resize(tokens.size());
  block.attention.apply(values, rows, inside.before_attention.data(), latent, inside.attention,
                        inside.looked.data());
  inside.middle = tokens;
  addGated(0, inside.looked, inside.middle);
  normalise(3, inside.middle, inside.before_mlp);
  inside.passed.resize(tokens.size());
  block.mlp.apply(values, rows, inside.before_mlp.data(), inside.mlp, inside.passed.data());
  std::vector<float> made = inside.middle;
  addGated(3, inside.passed, made);
  return made;
}

void TrainedOctree::backwardOfBlock(std::span<const float> values, const Block& block,
                                    std::span<Segment> segments, LatentRows& latent,
                                    const std::vector<float>& tokens, std::vector<float>& by_tokens,
                                    std::span<float> gradients) const {
  const size_t width = shape_.width(), rows = tokens.size() / width;
  Inside inside;
  runBlock(values, block, segments, latent, tokens, inside);
  std::vector<float> by_branch(tokens.size()), by_normal(tokens.size());
  const auto throughGate = [&](size_t which, const std::vector<float>& branch) {
    for (Segment& segment : segments) {
      const size_t first = segment.first * width, gate = (which + 2) * width;
      addScaledBackward(segment.count, width, std::span(segment.modulation).subspan(gate, width),
                        &branch[first], &by_tokens[first], &by_branch[first],
                        &segment.gradient[gate]);
    }
  };
  const auto throughNorm = [&](size_t which, const std::vector<float>& from) {
    for (Segment& segment : segments) {
      const size_t first = segment.first * width;
      const std::span<const float> all = segment.modulation;
      const LayerNorm norm = {width,
                              kTokenEpsilon,
                              {},
                              {},
                              all.subspan((which + 1) * width, width),
                              all.subspan(which * width, width)};
      layerNormBackward(norm, segment.count, &from[first], &by_normal[first],
                        {nullptr, nullptr, &segment.gradient[(which + 1) * width],
                         &segment.gradient[which * width]},
                        &by_tokens[first]);
    }
  };
  throughGate(3, inside.passed);
  block.mlp.backward(values, rows, inside.before_mlp.data(), inside.mlp, by_branch.data(),
                     gradients, by_normal.data());
  throughNorm(3, inside.middle);
  throughGate(0, inside.looked);
  block.attention.backward(values, rows, inside.before_attention.data(), inside.attention,
                           by_branch.data(), latent, gradients, by_normal.data());
  throughNorm(0, tokens);
}

void TrainedOctree::backwardOfModulation(std::span<const float> values, const Segment& segment,
                                         std::span<float> gradients) const {
  std::vector<float> by_embedded(shape_.width()), by_hidden(shape_.width());
  modulation_.backward(values, 1, segment.silu.data(), segment.gradient.data(), gradients,
                       by_embedded.data());
  activateBackward(Activation::kSilu, segment.embedded, by_embedded);
  level_out_.backward(values, 1, segment.activated.data(), by_embedded.data(), gradients,
                      by_hidden.data());
  activateBackward(Activation::kSilu, segment.hidden, by_hidden);
  level_in_.backward(values, 1, segment.encoding.data(), by_hidden.data(), gradients, nullptr);
}

std::vector<float> TrainedOctree::forward(std::span<const float> values, size_t tokens,
                                          const float* latent, std::span<const OctreeLevel> levels,
                                          Tape& tape) const {
  const size_t width = shape_.width();
  const std::vector<float> middles = middlesOf(levels);
  const size_t rows = middles.size() / 3;
  const std::vector<Segment> segments = segmentsOf(values, levels);
  tape.tokens.assign(1, std::vector<float>(rows * width));
  tape.latent.clear();
  embedding_.apply(values, rows, middles.data(), tape.tokens.front().data());
  Inside inside;
  for (const Block& block : blocks_) {
    tape.latent.push_back(block.attention.look(values, tokens, latent));
    tape.tokens.push_back(
        runBlock(values, block, segments, tape.latent.back(), tape.tokens.back(), inside));
  }
  std::vector<float> normal(rows * width), logits(rows * kChildren);
  layerNorm(lastTokenNorm(width), rows, tape.tokens.back().data(), normal.data());
  out_.apply(values, rows, normal.data(), logits.data());
  return logits;
}

void TrainedOctree::backward(std::span<const float> values, size_t tokens, const float* latent,
                             std::span<const OctreeLevel> levels, Tape& tape,
                             std::span<const float> logit_gradient, std::span<float> gradients,
                             float* latent_gradient) const {
  const size_t width = shape_.width();
  const std::vector<float> middles = middlesOf(levels);
  const size_t rows = middles.size() / 3;
  std::vector<Segment> segments = segmentsOf(values, levels);
  std::vector<float> normal(rows * width), by_normal(rows * width), by_tokens(rows * width, 0.0f);
  const std::vector<float>& last = tape.tokens.back();
  layerNorm(lastTokenNorm(width), rows, last.data(), normal.data());
  out_.backward(values, rows, normal.data(), logit_gradient.data(), gradients, by_normal.data());
  layerNormBackward(lastTokenNorm(width), rows, last.data(), by_normal.data(), {},
                    by_tokens.data());
  for (size_t i = blocks_.size(); i-- > 0;) {
    backwardOfBlock(values, blocks_[i], segments, tape.latent[i], tape.tokens[i], by_tokens,
                    gradients);
    blocks_[i].attention.backwardOfLatent(values, tokens, latent, tape.latent[i], gradients,
                                          latent_gradient);
  }
  embedding_.backward(values, rows, middles.data(), by_tokens.data(), gradients);
  for (const Segment& segment : segments) backwardOfModulation(values, segment, gradients);
}

}  // namespace stipple
