#pragma once

#include <cstdint>
#include <vector>

namespace stipple {

/// What a flow network is told of an image: two vectors of features for each token. Row k of one
/// belongs to row k of the other.
struct ImageCondition {
  uint64_t rows = 0;
  uint32_t structure_width = 0;  ///< 1280 of DINOv3 ViT-H/16+
  uint32_t colour_width = 0;     ///< 128 of the FLUX.2 VAE, packed
  std::vector<float> structure;  ///< [rows, structure_width]
  std::vector<float> colour;     ///< [rows, colour_width]
};

}  // namespace stipple
