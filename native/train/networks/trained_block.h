#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "nn/norms.h"
#include "train/networks/trained_layers.h"

namespace stipple {

/// Rows that tokens look at: a latent, or points with their features.
struct ContextRows {
  size_t count = 0;
  const float* values = nullptr;  ///< [count, NetworkShape::latent_width]
};

/// A block of the encoder and of the network of splats: tokens look at each other, then at one
/// context after the other, and then each goes through an MLP; each is normalised before and added
/// to the tokens.
class TrainedTokenBlock {
 public:
  /// Adds self_attn, mlp.mlp, and for each context norm2 and cross_attn, then norm2_1 and
  /// cross_attn2. In: contexts: 1 or 2.
  TrainedTokenBlock(ParameterLayout& layout, const std::string& prefix, const NetworkShape& shape,
                    size_t contexts);

  /// What the block sees of each context.
  std::vector<LatentRows> look(std::span<const float> values,
                               std::span<const ContextRows> contexts) const;
  /// In: tokens [rows, width]. Returns [rows, width].
  std::vector<float> apply(std::span<const float> values, std::span<const LatentRows> seen,
                           const std::vector<float>& tokens) const;
  /// The block is run again. In: seen and tokens as apply() had them; by_tokens [rows, width]: the
  /// derivative by what it made. Out: by_tokens: by `tokens`; gradients, and the derivatives in
  /// `seen`, which this adds to.
  void backward(std::span<const float> values, std::span<LatentRows> seen,
                const std::vector<float>& tokens, std::vector<float>& by_tokens,
                std::span<float> gradients) const;
  /// After backward(). Out: gradients; by_contexts: of each context [count, latent_width], which
  /// this adds to.
  void backwardOfContexts(std::span<const float> values, std::span<const ContextRows> contexts,
                          std::span<LatentRows> seen, std::span<float> gradients,
                          std::span<float* const> by_contexts) const;

 private:
  struct Look {
    size_t weight = 0, bias = 0;  ///< of the norm before it
    TrainedCrossAttention attention;
  };
  /// What is inside, of one run.
  struct Inside {
    std::vector<std::vector<float>> tokens, normal;  ///< before each part, and normalised
    TrainedSelfAttention::Tape self;
    std::vector<TrainedCrossAttention::Tape> looks;
    TrainedMlp::Tape mlp;
  };

  LayerNorm normOf(std::span<const float> values, const Look& look) const;
  std::vector<float> run(std::span<const float> values, std::span<const LatentRows> seen,
                         const std::vector<float>& tokens, Inside& inside) const;

  size_t width_;
  TrainedSelfAttention self_;
  std::vector<Look> looks_;
  TrainedMlp mlp_;
};

/// Blocks of that kind in a row.
class TrainedTokenStack {
 public:
  /// What apply() leaves for backward(): tokens before each block and after the last, and what each
  /// sees of the contexts.
  struct Tape {
    std::vector<std::vector<float>> tokens;
    std::vector<std::vector<LatentRows>> seen;
  };

  /// Adds the tensors of `prefix`blocks.0. and on.
  TrainedTokenStack(ParameterLayout& layout, const std::string& prefix, const NetworkShape& shape,
                    size_t contexts);
  /// In: tokens [rows, width]. Returns what the last block makes, as it is kept in the tape.
  const std::vector<float>& apply(std::span<const float> values,
                                  std::span<const ContextRows> contexts, std::vector<float> tokens,
                                  Tape& tape) const;
  /// In: by_tokens: by what apply() returned. Out: by_tokens: by the tokens that it was given;
  /// gradients and by_contexts, which this adds to.
  void backward(std::span<const float> values, std::span<const ContextRows> contexts, Tape& tape,
                std::vector<float>& by_tokens, std::span<float> gradients,
                std::span<float* const> by_contexts) const;

 private:
  std::vector<TrainedTokenBlock> blocks_;
};

}  // namespace stipple
