// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), density decoder, and the released
// network of that name. Differs: keys and values of the latent are computed once for all levels.
#include "decode/latent/octree_network.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "math/morton.h"
#include "nn/activations.h"
#include "nn/highway_backend.h"
#include "nn/matrix_backend.h"
#include "nn/norms.h"
#include "nn/positions.h"

namespace stipple {

namespace {

constexpr size_t kChildren = 8;
constexpr double kLongestLevel = 1024;

/// In float32 by our own kernels, which alone add up few rows in the order of many. They are within
/// some hundredths of the fastest.
NetworkRun withSameSums(NetworkRun run) {
  if (precisionOf(run) == FactorPrecision::kFloat32) run.backend = &highwayBackend();
  return run;
}

}  // namespace

OctreeNetwork::OctreeNetwork(const WeightTable& network)
    : source_(network.source()),
      heads_(readTokenHeads(network)),
      embedding_(network, heads_.tokenWidth()),
      level_in_(network, "l_embedder.mlp.0", kLevelWidth, heads_.tokenWidth()),
      level_out_(network, "l_embedder.mlp.2", heads_.tokenWidth(), heads_.tokenWidth()),
      modulation_(network, "adaLN_modulation.1", heads_.tokenWidth(), 6 * heads_.tokenWidth()),
      out_(network, "out_proj", heads_.tokenWidth(), kChildren) {
  const size_t count = network.countBlocks("blocks.");
  for (size_t i = 0; i < count; ++i) {
    const WeightTable block = network.under("blocks." + std::to_string(i) + ".");
    blocks_.push_back({CrossAttention(block.under("cross_attn."), heads_),
                       TokenMlp(block.under("mlp.mlp."), heads_.tokenWidth())});
    // All look at the same latent, in the same room.
    block.require("cross_attn.to_kv.weight", {2 * heads_.tokenWidth(), latentWidth()});
    block.require("mlp.mlp.0.weight", {blocks_.front().mlp.hiddenWidth(), heads_.tokenWidth()});
  }
}

LatentKeys OctreeNetwork::keysOf(const NetworkRun& run, const Latent& latent) const {
  requireLatent(latent, latentWidth());
  LatentKeys keys;
  keys.rows = SharedRows(latent.token_count, latent.width, latent.tokens.data());
  for (const Block& block : blocks_) keys.rates.push_back(block.attention.ratesOf(run, latent));
  return keys;
}

uint64_t OctreeNetwork::keyBytes(uint64_t token_count) const {
  return latentKeyBytes(token_count, latentWidth(), blocks_.size(), heads_);
}

uint64_t OctreeNetwork::workBytes() const {
  // Tokens, two rooms for what is made of them, the inside of an MLP, points.
  return kRows * (3 * heads_.tokenWidth() + blocks_.front().mlp.hiddenWidth() + 3) * sizeof(float);
}

std::vector<float> OctreeNetwork::centresOf(int level, std::span<const uint64_t> cells) {
  std::vector<float> centres;
  centres.reserve(3 * cells.size());
  for (const uint64_t cell : cells) {
    for (const uint32_t at : mortonDecode(cell)) {
      centres.push_back(std::ldexp(static_cast<float>(at) + 0.5f, -level));
    }
  }
  return centres;
}

std::vector<float> OctreeNetwork::levelEncoding(int level) {
  // The network is told how many cells the children's level has along a side.
  const double side = std::ldexp(2 * std::numbers::pi, level + 1);
  return timeEncoding(side, kLongestLevel, kLevelWidth);
}

std::vector<float> OctreeNetwork::modulationOf(const NetworkRun& run, int level) const {
  const std::vector<float> encoding = levelEncoding(level);
  const size_t width = heads_.tokenWidth();
  std::vector<float> hidden(width), embedded(width), modulation(6 * width);
  level_in_.apply(run, 1, encoding.data(), hidden.data());
  activate(Activation::kSilu, hidden);
  level_out_.apply(run, 1, hidden.data(), embedded.data());
  activate(Activation::kSilu, embedded);
  modulation_.apply(run, 1, embedded.data(), modulation.data());
  return modulation;
}

void OctreeNetwork::logits(const NetworkRun& asked, const LatentKeys& keys, int level,
                           std::span<const uint64_t> cells, std::span<float> out) const {
  const NetworkRun run = withSameSums(asked);
  const size_t width = heads_.tokenWidth();
  const std::vector<float> modulation = modulationOf(run, level);
  const auto part = [&](size_t i) { return std::span(modulation).subspan(i * width, width); };
  const LayerNorm before_attention = {width, kTokenEpsilon, {}, {}, part(1), part(0)};
  const LayerNorm before_mlp = {width, kTokenEpsilon, {}, {}, part(4), part(3)};
  const LayerNorm last = lastTokenNorm(width);
  const size_t most = std::min(cells.size(), kRows);
  std::vector<float> tokens(most * width), room(most * width), scratch(most * width);
  std::vector<float> hidden(most * blocks_.front().mlp.hiddenWidth());
  for (size_t begin = 0; begin < cells.size(); begin += kRows) {
    const size_t rows = std::min(kRows, cells.size() - begin);
    const std::vector<float> points = centresOf(level, cells.subspan(begin, rows));
    embedding_.apply(run, rows, points.data(), scratch.data(), tokens.data());
    for (size_t i = 0; i < blocks_.size(); ++i) {
      const Block& block = blocks_[i];
      if (run.progress) run.progress->throwIfCancelled();
      layerNorm(before_attention, rows, tokens.data(), room.data());
      block.attention.apply(run, rows, room.data(), keys.rows, keys.rates[i], scratch.data(),
                            room.data());
      addScaled(rows, width, part(2), room.data(), tokens.data());
      layerNorm(before_mlp, rows, tokens.data(), room.data());
      block.mlp.apply(run, rows, room.data(), hidden.data(), room.data());
      addScaled(rows, width, part(5), room.data(), tokens.data());
    }
    layerNorm(last, rows, tokens.data(), tokens.data());
    out_.apply(run, rows, tokens.data(), &out[begin * kChildren]);
  }
  for (size_t i = 0; i < cells.size() * kChildren; ++i) {
    if (std::isfinite(out[i])) continue;
    fail(ErrorCode::kFormat, source_ + " makes a logit of a cell of level " +
                                 std::to_string(level) + " that is " + std::to_string(out[i]) +
                                 "; finite numbers are needed");
  }
}

}  // namespace stipple
