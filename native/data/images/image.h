#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stipple {

/// How the numbers of a picture relate to light.
enum class Transfer : uint32_t {
  kLinear = 0,  ///< scene linear Rec.709
  kSrgb = 1,    ///< display sRGB
};

/// A picture in memory. Row 0 is the top; alpha, where there is one, is premultiplied.
struct Image {
  uint32_t width = 0;
  uint32_t height = 0;
  uint32_t channels = 0;      ///< 1 (grey), 3 (RGB) or 4 (RGBA)
  std::vector<float> pixels;  ///< [height, width, channels]
  Transfer transfer = Transfer::kLinear;

  size_t pixelCount() const { return static_cast<size_t>(width) * height; }
};

}  // namespace stipple
