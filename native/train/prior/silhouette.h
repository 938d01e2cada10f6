#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Where a picture shows something, in blocks of pixels; any rectangle of them is asked in four
/// reads.
class Silhouette {
 public:
  Silhouette() = default;
  /// A block shows something where one of its pixels does: alpha above `least_alpha`, or weight 0,
  /// as what a mask leaves out may be anything.
  /// In: alpha [height,width]; weights [height,width] or empty: 1; block >= 1, pixels a side.
  Silhouette(uint32_t width, uint32_t height, std::span<const float> alpha,
             std::span<const float> weights, uint32_t block, float least_alpha);

  /// Blocks a side; 0 of an empty one, which must not be asked.
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

  /// Whether any block from (x0, y0) to before (x1, y1) shows something.
  /// In: x0 <= x1 <= width(), y0 <= y1 <= height().
  bool shows(uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1) const {
    const size_t stride = width_ + size_t{1};
    return sums_[y1 * stride + x1] - sums_[y0 * stride + x1] - sums_[y1 * stride + x0] +
               sums_[y0 * stride + x0] >
           0;
  }

  /// The same of a block and those around it.
  bool showsAround(uint32_t x, uint32_t y) const {
    const auto before = [](uint32_t at) { return at > 0 ? at - 1 : 0; };
    const auto after = [](uint32_t at, uint32_t count) { return at + 2 < count ? at + 2 : count; };
    return shows(before(x), before(y), after(x, width_), after(y, height_));
  }

 private:
  uint32_t width_ = 0, height_ = 0;
  std::vector<uint32_t> sums_;  ///< [height + 1, width + 1] of all blocks before
};

}  // namespace stipple
