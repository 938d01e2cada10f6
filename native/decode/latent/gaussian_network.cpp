// Based on: DeG, density-sampled Gaussians (arXiv 2605.16355), attribute decoder, and the released
// network of that name.
#include "decode/latent/gaussian_network.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "nn/activations.h"
#include "nn/norms.h"

namespace stipple {

namespace {

/// Outputs for a Gaussian: centre, colour and scale, rotation, opacity, spread.
constexpr size_t kGaussianOutputs = 15;
/// As SplatLayout has them.
constexpr uint64_t kLeastGaussians = 4;
constexpr uint64_t kMostGaussians = 32;
/// Anchors whose MLP is worked on at once.
constexpr size_t kMlpRows = 2048;

/// K of the file.
uint32_t readGaussians(const WeightTable& network) {
  constexpr char kLattice[] = "points_offset_perturbation";
  const uint64_t count = network.require(kLattice, {kAnySize, 3}).shape[0];
  if (count < kLeastGaussians || count > kMostGaussians) {
    fail(ErrorCode::kFormat, network.source() + ": " + kLattice + " is of " +
                                 std::to_string(count) + " Gaussians for each anchor; " +
                                 std::to_string(kLeastGaussians) + " to " +
                                 std::to_string(kMostGaussians) + " can be decoded");
  }
  return static_cast<uint32_t>(count);
}

/// 0 where the file has none, as the published one.
float readSpacingUnit(const WeightTable& network) {
  constexpr char kUnit[] = "spacing_unit";
  if (!network.has(kUnit)) return 0;
  const float unit = network.floats(kUnit, {1}).front();
  if (unit > 0 && unit <= 1) return unit;
  fail(ErrorCode::kFormat, network.source() + ": " + kUnit + " is " + numberText(unit) +
                               "; more than 0, and 1 at most, is allowed");
}

/// Multiplications of the attention to a latent for each number of a token, of which rows and
/// queries of a head meet twice.
double sharedWork(const TokenHeads& heads, const SharedRows& latent) {
  return static_cast<double>(2 * latent.count * (latent.width + 1)) /
         static_cast<double>(heads.width);
}

/// Progress by multiplications that are done, in arbitrary units.
class WorkDone {
 public:
  WorkDone(Progress* progress, double whole) : progress_(progress), whole_(whole) {}
  void add(double work) {
    done_ += work;
    advance(progress_, std::min(done_ / whole_, 1.0), "Decoding splats");
  }

 private:
  Progress* progress_;
  double whole_;
  double done_ = 0;
};

}  // namespace

GaussianNetwork::GaussianNetwork(const WeightTable& network)
    : source_(network.source()),
      heads_(readTokenHeads(network)),
      embedding_(network, heads_.tokenWidth()),
      gaussians_(readGaussians(network)) {
  const size_t width = heads_.tokenWidth();
  out_ = Linear(network, "out_proj", width, kGaussianOutputs * gaussians_);
  lattice_ = network.floats("points_offset_perturbation", {gaussians_, 3});
  spread_bias_ = network.floats("base_offset_scale", {1}).front();
  spacing_unit_ = readSpacingUnit(network);
  const size_t count = network.countBlocks("blocks.");
  for (size_t i = 0; i < count; ++i) {
    const WeightTable block = network.under("blocks." + std::to_string(i) + ".");
    blocks_.push_back({SelfAttention(block.under("self_attn."), heads_),
                       CrossAttention(block.under("cross_attn."), heads_),
                       block.floats("norm2.weight", {width}), block.floats("norm2.bias", {width}),
                       TokenMlp(block.under("mlp.mlp."), width)});
    // All look at the same latent, in the same room.
    block.require("cross_attn.to_kv.weight", {2 * width, latentWidth()});
    block.require("mlp.mlp.0.weight", {blocks_.front().mlp.hiddenWidth(), width});
  }
}

LatentKeys GaussianNetwork::keysOf(const NetworkRun& run, const Latent& latent) const {
  requireLatent(latent, latentWidth());
  LatentKeys keys;
  keys.rows = SharedRows(latent.token_count, latent.width, latent.tokens.data());
  for (const Block& block : blocks_) keys.rates.push_back(block.cross.ratesOf(run, latent));
  return keys;
}

uint64_t GaussianNetwork::keyBytes(uint64_t token_count) const {
  return latentKeyBytes(token_count, latentWidth(), blocks_.size(), heads_);
}

std::vector<float> GaussianNetwork::features(const NetworkRun& run, const LatentKeys& keys,
                                             size_t rows, const float* points) const {
  const size_t width = heads_.tokenWidth();
  const size_t hidden_width = blocks_.front().mlp.hiddenWidth();
  const size_t mlp_rows = std::min(rows, kMlpRows);
  std::vector<float> tokens(rows * width), room(rows * width);
  std::vector<float> scratch(std::max(rows * 3 * width, mlp_rows * hidden_width));
  // Multiplications for each number of a token.
  const double self = static_cast<double>(4 * width + 2 * rows);
  const double cross = static_cast<double>(2 * width) + sharedWork(heads_, keys.rows);
  const double mlp = static_cast<double>(2 * hidden_width);
  WorkDone work(run.progress, static_cast<double>(blocks_.size()) * (self + cross + mlp));
  work.add(0);
  embedding_.apply(run, rows, points, scratch.data(), tokens.data());
  const LayerNorm plain = {width, kTokenEpsilon, {}, {}, {}, {}};
  for (size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    layerNorm(plain, rows, tokens.data(), room.data());
    block.self.apply(run, rows, room.data(), scratch.data(), room.data());
    addScaled(rows, width, {}, room.data(), tokens.data());
    work.add(self);
    layerNorm({width, kTokenEpsilon, block.cross_weight, block.cross_bias, {}, {}}, rows,
              tokens.data(), room.data());
    block.cross.apply(run, rows, room.data(), keys.rows, keys.rates[i], scratch.data(),
                      room.data());
    addScaled(rows, width, {}, room.data(), tokens.data());
    work.add(cross);
    for (size_t begin = 0; begin < rows; begin += mlp_rows) {
      const size_t count = std::min(mlp_rows, rows - begin);
      float* part = &tokens[begin * width];
      layerNorm(plain, count, part, room.data());
      block.mlp.apply(run, count, room.data(), scratch.data(), room.data());
      addScaled(count, width, {}, room.data(), part);
      work.add(mlp * static_cast<double>(count) / static_cast<double>(rows));
    }
  }
  const LayerNorm last = lastTokenNorm(width);
  layerNorm(last, rows, tokens.data(), tokens.data());
  std::vector<float> features(rows * out_.outputs());
  out_.apply(run, rows, tokens.data(), features.data());
  for (const float value : features) {
    if (std::isfinite(value)) continue;
    fail(ErrorCode::kFormat, source_ + " makes an attribute of a splat that is " +
                                 std::to_string(value) + "; finite numbers are needed");
  }
  return features;
}

uint64_t GaussianNetwork::memoryBound(uint64_t rows) const {
  const uint64_t width = heads_.tokenWidth();
  const uint64_t mlp_rows = std::min<uint64_t>(rows, kMlpRows);
  const uint64_t scratch = std::max(rows * 3 * width, mlp_rows * blocks_.front().mlp.hiddenWidth());
  return (rows * (2 * width + out_.outputs()) + scratch) * sizeof(float);
}

}  // namespace stipple
