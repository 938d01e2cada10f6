#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "train/networks/trained_block.h"

namespace stipple {

/// decode/latent/gaussian_network.h as it is trained: anchors become the raw attributes of K
/// Gaussians each, in the order of SplatLayout.
class TrainedGaussians {
 public:
  struct Tape {
    TrainedTokenStack::Tape blocks;
    std::vector<float> normal;  ///< [rows, width], before the last layer
  };

  /// Adds its tensors, under `prefix` ("gs.").
  TrainedGaussians(ParameterLayout& layout, const std::string& prefix, const NetworkShape& shape,
                   uint32_t gaussians);

  /// In: latent; points [rows,3] in the unit cube. Returns [rows, 15 K].
  std::vector<float> forward(std::span<const float> values, const ContextRows& latent, size_t rows,
                             const float* points, Tape& tape) const;
  /// In: what forward() had and left; gradient [rows, 15 K]. Out: gradients and latent_gradient,
  /// which this adds to. Anchors have no derivative: they are drawn.
  void backward(std::span<const float> values, const ContextRows& latent, size_t rows,
                const float* points, Tape& tape, std::span<const float> gradient,
                std::span<float> gradients, float* latent_gradient) const;

 private:
  size_t width_;
  TrainedPointEmbedding embedding_;
  TrainedTokenStack blocks_;
  TrainedLinear out_;
};

}  // namespace stipple
