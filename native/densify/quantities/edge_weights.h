#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// How much of an edge each pixel of a picture is, on the bright side of edges: the Laplacian of
/// the luminance, as 8-bit numbers give it, negative answers 0, over the largest of the picture. 0
/// on its outermost pixels, and everywhere in a picture that is flat. In: rgb [H,W,3] display
/// values, those outside 0..1 count as the nearer end. Out: [H,W] 0..1.
std::vector<float> edgeWeights(uint32_t width, uint32_t height, std::span<const float> rgb);

}  // namespace stipple
