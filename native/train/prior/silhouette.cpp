#include "train/prior/silhouette.h"

namespace stipple {

Silhouette::Silhouette(uint32_t width, uint32_t height, std::span<const float> alpha,
                       std::span<const float> weights, uint32_t block, float least_alpha)
    : width_((width + block - 1) / block), height_((height + block - 1) / block) {
  const size_t stride = width_ + size_t{1};
  sums_.assign(stride * (height_ + size_t{1}), 0);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const size_t i = size_t{y} * width + x;
      const bool is_masked = !weights.empty() && weights[i] <= 0;
      if (!is_masked && alpha[i] <= least_alpha) continue;
      sums_[(y / block + size_t{1}) * stride + x / block + 1] = 1;
    }
  }
  for (size_t y = 0; y < height_; ++y) {
    for (size_t x = 0; x < width_; ++x) {
      const size_t at = (y + 1) * stride + x + 1;
      sums_[at] += sums_[at - 1] + sums_[at - stride] - sums_[at - stride - 1];
    }
  }
}

}  // namespace stipple
