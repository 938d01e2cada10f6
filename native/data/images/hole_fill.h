#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Fills the pixels that are not known from ever coarser means of those that are: each takes the
/// mean of the smallest square of 2, 4, 8, ... pixels aside around it that holds a known one.
/// Squares are counted from the first row and column. In: colour [H,W,3], finite where it is known;
/// known [H,W] 0 or 1. Returns [H,W,3]; 0 where nothing at all is known. Cost: O(pixels).
/// Based on: Gortler et al., The Lumigraph, SIGGRAPH 1996, section 3.5 (pull and push). Differs: a
/// box of four pixels, and no blending of levels.
std::vector<float> filledHoles(std::span<const float> colour, std::span<const uint8_t> known,
                               uint32_t width, uint32_t height);

}  // namespace stipple
