#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "data/latent.h"
#include "data/weight_table.h"
#include "nn/linear.h"
#include "nn/network_run.h"

namespace stipple {

// The layers that the octree network and the Gaussian network of density-sampled Gaussians have in
// common. Tokens lie as rows of `width` floats without gaps. None of these takes a decision: which
// is applied to what is the networks' (octree_network.cpp, gaussian_network.cpp).

/// How the tokens of a network are cut into heads, which no other tensor of its file tells.
struct TokenHeads {
  size_t count = 0;
  size_t width = 0;  ///< numbers in a head

  size_t tokenWidth() const { return count * width; }
};

/// Of the first block of a network. Errors: kFormat for a tensor "blocks.0.cross_attn.q_rms_norm.
/// gamma" that is missing or no table of heads.
TokenHeads readTokenHeads(const WeightTable& network);

/// Refuses a latent that is empty, not finite, or of another width than a network reads.
/// Errors: kInvalidArgument.
void requireLatent(const Latent& latent, size_t width);

/// Points become tokens: two linear layers with the encoding of positions added between them.
class PointEmbedding {
 public:
  /// Reads "in_proj" and "input_layer". Errors: kFormat.
  PointEmbedding(const WeightTable& network, size_t width);
  /// In: points [rows,3] in the unit cube; scratch [rows, width]. Out: tokens [rows, width].
  void apply(const NetworkRun& run, size_t rows, const float* points, float* scratch,
             float* tokens) const;

 private:
  Linear in_, out_;
};

/// Tokens look at a latent. Queries and keys are normalised for each head.
class CrossAttention {
 public:
  /// In: weights, under "blocks.i.cross_attn.". Errors: kFormat.
  CrossAttention(const WeightTable& weights, const TokenHeads& heads);

  size_t latentWidth() const { return to_keys_.inputs(); }
  /// What a latent's tokens are looked at as: [tokens, 2 width], keys and behind them values. The
  /// same for all that look at it.
  std::vector<float> keysOf(const NetworkRun& run, const Latent& latent) const;
  /// In: in [rows, width]; keys, as keysOf() returns them; scratch [rows, width].
  /// Out: out [rows, width]; it may be `in`.
  void apply(const NetworkRun& run, size_t rows, const float* in, std::span<const float> keys,
             float* scratch, float* out) const;

 private:
  TokenHeads heads_;
  Linear to_queries_, to_keys_, to_out_;
  std::vector<float> query_gamma_, key_gamma_;
};

/// Tokens look at each other.
class SelfAttention {
 public:
  /// In: weights, under "blocks.i.self_attn.". Errors: kFormat.
  SelfAttention(const WeightTable& weights, const TokenHeads& heads);
  /// In: in [rows, width]; scratch [rows, 3 width]. Out: out [rows, width]; it may be `in`.
  void apply(const NetworkRun& run, size_t rows, const float* in, float* scratch, float* out) const;

 private:
  TokenHeads heads_;
  Linear to_all_, to_out_;
  std::vector<float> query_gamma_, key_gamma_;
};

/// Each token by itself: two linear layers with a GELU between them.
class TokenMlp {
 public:
  /// In: weights, under "blocks.i.mlp.mlp.". Errors: kFormat.
  TokenMlp(const WeightTable& weights, size_t width);

  size_t hiddenWidth() const { return up_.outputs(); }
  /// In: in [rows, width]; scratch [rows, hiddenWidth()]. Out: out [rows, width]; it may be `in`.
  void apply(const NetworkRun& run, size_t rows, const float* in, float* scratch, float* out) const;

 private:
  Linear up_, down_;
};

}  // namespace stipple
