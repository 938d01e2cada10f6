#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "decode/latent/token_layers.h"

namespace stipple {

/// The network that turns anchors into the raw attributes of K Gaussians each. Every anchor looks
/// at all anchors and at the latent.
class GaussianNetwork {
 public:
  /// In: network, under "gs.". Errors: kFormat.
  explicit GaussianNetwork(const WeightTable& network);

  size_t latentWidth() const { return blocks_.front().cross.latentWidth(); }
  /// K, 4..32.
  uint32_t gaussians() const { return gaussians_; }
  /// [K,3]: what is added to raw centres, so that those of zeros fill a lattice.
  const std::vector<float>& lattice() const { return lattice_; }
  /// What is added to raw spreads.
  float spreadBias() const { return spread_bias_; }
  /// Lengths are multiples of how far apart anchors stand over this, in the unit cube; 0: they are
  /// in the unit of the published network, whatever the budget is.
  float spacingUnit() const { return spacing_unit_; }
  const std::string& source() const { return source_; }

  /// What anchors see of a latent. Errors: kInvalidArgument for one that requireLatent() refuses;
  /// kCancelled.
  LatentKeys keysOf(const NetworkRun& run, const Latent& latent) const;
  uint64_t keyBytes(uint64_t token_count) const;
  /// In: keys, of keysOf(); points [rows,3] in the unit cube. Returns [rows, 15 K] in the order of
  /// SplatLayout. Errors: kFormat where a result is not finite; kCancelled. Threads and
  /// determinism: parallel; same bits for any number of threads. Cost: O(rows^2 + rows * tokens).
  std::vector<float> features(const NetworkRun& run, const LatentKeys& keys, size_t rows,
                              const float* points) const;
  /// Bytes that features() holds at most, its result included.
  uint64_t memoryBound(uint64_t rows) const;

 private:
  struct Block {
    SelfAttention self;
    CrossAttention cross;
    std::vector<float> cross_weight, cross_bias;  // of the norm before it
    TokenMlp mlp;
  };

  std::string source_;
  TokenHeads heads_;
  PointEmbedding embedding_;
  std::vector<Block> blocks_;
  Linear out_;
  uint32_t gaussians_ = 0;
  std::vector<float> lattice_;
  float spread_bias_ = 0;
  float spacing_unit_ = 0;
};

}  // namespace stipple
