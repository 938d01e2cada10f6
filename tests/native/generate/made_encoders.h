#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "generate/encoder_shapes.h"
#include "nn/made_weights.h"

namespace stipple {

/// Random weights for all names but one.
inline MadeWeights madeOf(const WeightShapes& shapes, const std::string& left_out) {
  MadeWeights made;
  made.leaveOut(left_out);
  for (const auto& [name, shape] : shapes) made.addAsNamed(name, shape);
  return made;
}

/// Random weights of a vision transformer (dinoShapes()). In: left_out: a tensor that is missing.
inline MadeWeights madeDino(uint64_t width, uint64_t inner, size_t layers,
                            const std::string& layer_prefix = "layer.",
                            const std::string& left_out = "") {
  return madeOf(dinoShapes(width, inner, layers, layer_prefix), left_out);
}

/// Random weights of an autoencoder's encoder (vaeShapes()); variances of tokens are 0.8.
inline MadeWeights madeVae(const std::vector<uint64_t>& channels, uint64_t latent,
                           const std::string& left_out = "") {
  MadeWeights made = madeOf(vaeShapes(channels, latent), left_out);
  made.add("bn.running_var", {4 * latent}, std::vector<float>(4 * latent, 0.8f));
  return made;
}

}  // namespace stipple
