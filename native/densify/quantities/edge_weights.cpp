// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, section 3.1 and its published program: luminance of
// ITU-R BT.601 in 16-bit integers, eight neighbours. Differs: the outermost pixels are 0 there; the
// program's filter leaves their brightness.

#include "densify/quantities/edge_weights.h"

#include <algorithm>

namespace stipple {

namespace {

uint8_t byteOf(float value) {
  return static_cast<uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f);
}

std::vector<uint8_t> luminance(size_t pixel_count, const float* rgb) {
  std::vector<uint8_t> values(pixel_count);
  for (size_t i = 0; i < pixel_count; ++i) {
    const uint32_t r = byteOf(rgb[i * 3]), g = byteOf(rgb[i * 3 + 1]), b = byteOf(rgb[i * 3 + 2]);
    values[i] = static_cast<uint8_t>((19595 * r + 38470 * g + 7471 * b + 32768) >> 16);
  }
  return values;
}

}  // namespace

std::vector<float> edgeWeights(uint32_t width, uint32_t height, std::span<const float> rgb) {
  const size_t pixel_count = size_t{width} * height;
  std::vector<float> weights(pixel_count, 0.0f);
  if (width < 3 || height < 3) return weights;
  const std::vector<uint8_t> bright = luminance(pixel_count, rgb.data());
  std::vector<int> columns(width);  // sums of three rows
  int largest = 0;
  for (size_t y = 1; y + 1 < height; ++y) {
    const uint8_t* above = &bright[(y - 1) * width];
    const uint8_t* row = above + width;
    const uint8_t* below = row + width;
    for (size_t x = 0; x < width; ++x) columns[x] = above[x] + row[x] + below[x];
    for (size_t x = 1; x + 1 < width; ++x) {
      const int answer = 9 * row[x] - columns[x - 1] - columns[x] - columns[x + 1];
      const int held = std::clamp(answer, 0, 255);
      largest = std::max(largest, held);
      weights[y * width + x] = static_cast<float>(held);
    }
  }
  if (largest == 0) return weights;
  const float scale = 1.0f / static_cast<float>(largest);
  for (float& weight : weights) weight *= scale;
  return weights;
}

}  // namespace stipple
