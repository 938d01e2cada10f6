#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "base/default_init_vector.h"
#include "nn/training/parameter_layout.h"
#include "nn/training/trained_linear.h"
#include "nn/training/trained_mlp.h"

namespace stipple {

// The layers of decode/latent/token_layers.h as they are trained. They know where their numbers are
// in arrays of a ParameterLayout: values are handed to every call, derivatives are added to.
// Tokens lie as rows of `width` floats without gaps.

/// How wide a network is.
struct NetworkShape {
  size_t heads = 0;
  size_t head_width = 0;
  size_t latent_width = 0;  ///< numbers of a token of the latent
  size_t block_count = 0;
  size_t mlp_ratio = 4;  ///< of the inside of an MLP to the width

  size_t width() const { return heads * head_width; }
};

/// Points become tokens: two linear layers with the encoding of positions added between them.
class TrainedPointEmbedding {
 public:
  /// Adds `prefix`in_proj and `prefix`input_layer.
  TrainedPointEmbedding(ParameterLayout& layout, const std::string& prefix, size_t width);
  /// In: points [rows,3] in the unit cube. Out: tokens [rows, width].
  void apply(std::span<const float> values, size_t rows, const float* points, float* tokens) const;
  /// Points have no derivative: they are drawn. In: gradient [rows, width] by tokens.
  void backward(std::span<const float> values, size_t rows, const float* points,
                const float* gradient, std::span<float> gradients) const;

 private:
  std::vector<float> inside(std::span<const float> values, size_t rows, const float* points) const;

  TrainedLinear in_, out_;
};

/// What a layer of cross-attention sees of a latent, and, on the way back, the derivative by it.
struct LatentRows {
  std::vector<float> made;  ///< [tokens, 2 width]: keys before their norm, values
  std::vector<float> keys;  ///< [tokens, width], normalised
  /// [tokens, 2 width]: by normalised keys and values, added up; empty until there is some.
  DefaultInitVector<float> gradient;
};

/// Tokens look at a latent. Queries and keys are normalised for each head.
class TrainedCrossAttention {
 public:
  /// What apply() leaves for backward(), [rows, width] each.
  struct Tape {
    std::vector<float> made, queries, attended;
  };

  /// Adds `prefix`to_q, to_kv, q_rms_norm, k_rms_norm and to_out.
  TrainedCrossAttention(ParameterLayout& layout, const std::string& prefix,
                        const NetworkShape& shape);
  /// In: latent [tokens, latent_width].
  LatentRows look(std::span<const float> values, size_t tokens, const float* latent) const;
  /// In: in [rows, width]. Out: out [rows, width], apart from `in`.
  void apply(std::span<const float> values, size_t rows, const float* in, const LatentRows& latent,
             Tape& tape, float* out) const;
  /// In: in and tape of apply(). Out: gradients; latent.gradient, which this adds to; in_gradient
  /// [rows, width], written over.
  void backward(std::span<const float> values, size_t rows, const float* in, const Tape& tape,
                const float* out_gradient, LatentRows& latent, std::span<float> gradients,
                float* in_gradient) const;
  /// Once all rows have been through backward(). In: latent as look() had it. Out: gradients;
  /// latent_gradient [tokens, latent_width], which this adds to; rows, whose gradient becomes that
  /// before the norm.
  void backwardOfLatent(std::span<const float> values, size_t tokens, const float* latent,
                        LatentRows& rows, std::span<float> gradients, float* latent_gradient) const;

 private:
  std::span<const float> gammaOf(std::span<const float> values, size_t first) const {
    return values.subspan(first, shape_.width());
  }

  NetworkShape shape_;
  TrainedLinear to_queries_, to_latent_;
  size_t query_gamma_ = 0, key_gamma_ = 0;
  TrainedLinear to_out_;
};

/// Tokens look at each other.
class TrainedSelfAttention {
 public:
  /// What apply() leaves for backward().
  struct Tape {
    std::vector<float> made;      ///< [rows, 3 width]: queries, keys, values, before their norms
    std::vector<float> normal;    ///< [rows, 3 width]: after them
    std::vector<float> attended;  ///< [rows, width]
  };

  /// Adds `prefix`to_qkv, q_rms_norm, k_rms_norm and to_out.
  TrainedSelfAttention(ParameterLayout& layout, const std::string& prefix,
                       const NetworkShape& shape);
  /// In: in [rows, width]. Out: out [rows, width], apart from `in`.
  void apply(std::span<const float> values, size_t rows, const float* in, Tape& tape,
             float* out) const;
  /// In: in and tape of apply(). Out: gradients; in_gradient [rows, width], written over.
  void backward(std::span<const float> values, size_t rows, const float* in, const Tape& tape,
                const float* out_gradient, std::span<float> gradients, float* in_gradient) const;

 private:
  NetworkShape shape_;
  TrainedLinear to_all_;
  size_t query_gamma_ = 0, key_gamma_ = 0;
  TrainedLinear to_out_;
};

/// Each token by itself: adds `prefix`0 and `prefix`2, with a GELU between them.
TrainedMlp trainedTokenMlp(ParameterLayout& layout, const std::string& prefix,
                           const NetworkShape& shape);

}  // namespace stipple
