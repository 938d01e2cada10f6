#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

/// A picture whose bytes are data: four per pixel, row by row.
struct RgbaBytes {
  uint32_t width = 0;
  uint32_t height = 0;
  std::vector<uint8_t> bytes;  ///< [height, width, 4]

  uint64_t pixelCount() const { return uint64_t{width} * height; }
};

/// The longest side of a WebP picture.
constexpr uint32_t kMaxWebpSide = 16383;

/// Decodes a WebP picture in memory; every byte as it was written where it is lossless.
/// In: name, what messages call it; max_pixels, refused with kFormat before anything is allocated.
RgbaBytes decodeWebp(const std::vector<uint8_t>& bytes, uint64_t max_pixels,
                     const std::string& name);

/// Lossless WebP that gives back every byte, under an alpha of 0 too.
std::vector<uint8_t> encodeWebp(const RgbaBytes& image, const std::string& name);

}  // namespace stipple
