#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/latent.h"
#include "data/weight_table.h"
#include "nn/linear.h"
#include "nn/network_run.h"
#include "nn/norms.h"
#include "nn/shared_attention.h"

namespace stipple {

// The layers that the octree network and the Gaussian network of density-sampled Gaussians have in
// common. Tokens lie as rows of `width` floats without gaps. None of these takes a decision: which
// is applied to what is the networks' (octree_network.cpp, gaussian_network.cpp).

/// What norms inside of blocks add to variances.
constexpr float kTokenEpsilon = 1e-6f;
/// The norm before a network's last layer.
LayerNorm lastTokenNorm(size_t width);

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

/// What the blocks of a network see of a latent. A key has the length that its head's factors give
/// it, which is all that is kept of it.
struct LatentKeys {
  SharedRows rows;                        ///< the latent's tokens
  std::vector<std::vector<float>> rates;  ///< for each block [heads, tokens]: 1 / |key|
};

/// Bytes of those of `blocks` blocks, and what it takes to make them.
uint64_t latentKeyBytes(uint64_t token_count, size_t latent_width, size_t blocks,
                        const TokenHeads& heads);

/// Keys of one latent, made where they are first wanted and then kept.
class KeptKeys {
 public:
  /// In: make, which returns them. Errors: those of make(), after which there are none.
  template <class Make>
  std::shared_ptr<const LatentKeys> get(const Make& make) const {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (keys_) return keys_;
    }
    // Not under the lock: whoever waits for parallel work may be handed a task that wants it, too.
    auto made = std::make_shared<const LatentKeys>(make());
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!keys_) keys_ = std::move(made);
    return keys_;
  }

 private:
  mutable std::mutex mutex_;  // of keys_
  mutable std::shared_ptr<const LatentKeys> keys_;
};

/// Tokens look at a latent. Queries and keys are normalised for each head.
class CrossAttention {
 public:
  /// In: weights, under "blocks.i.cross_attn.". Errors: kFormat.
  CrossAttention(const WeightTable& weights, const TokenHeads& heads);

  size_t latentWidth() const { return to_keys_.inputs(); }
  /// 1 / |key| of the latent's tokens, [heads, tokens]. Errors: kCancelled.
  std::vector<float> ratesOf(const NetworkRun& run, const Latent& latent) const;
  /// In: in [rows, width]; latent, and the rates that ratesOf() returns for it; scratch
  /// [rows, width]. Out: out [rows, width]; it may be `in`.
  void apply(const NetworkRun& run, size_t rows, const float* in, const SharedRows& latent,
             std::span<const float> rates, float* scratch, float* out) const;

 private:
  TokenHeads heads_;
  Linear to_queries_, to_keys_, to_out_;
  std::vector<float> query_gamma_;
  std::vector<float> key_maps_, value_maps_;  // as SharedHeads has them
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
