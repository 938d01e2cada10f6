#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/images/image.h"

namespace stipple {

/// A picture of bytes as files of 8 bits hold it: display sRGB, straight alpha. Row 0 is the top.
struct ByteImage {
  uint32_t width = 0;
  uint32_t height = 0;
  uint32_t channels = 0;        ///< 1 (grey), 3 (RGB) or 4 (RGBA)
  std::vector<uint8_t> pixels;  ///< [height, width, channels]

  size_t pixelCount() const { return static_cast<size_t>(width) * height; }
};

/// The bytes of a picture, rounded: those of its file where that has 8 bits, except for the colours
/// behind an alpha of 0, which become 0. Linear light becomes display sRGB.
ByteImage toByteImage(const Image& image);

/// One channel that says how far each pixel is part of something: the alpha of a picture that is
/// not opaque everywhere, else its brightness, (19595 R + 38470 G + 7471 B) / 65536 rounded.
ByteImage toMask(const ByteImage& image);

/// Refuses a picture without pixels, with other numbers of channels, or with less or more bytes
/// than it needs. In: what: names it at the start of a message ("The image"). Errors:
/// kInvalidArgument.
void requireByteImage(const ByteImage& image, const char* what);

}  // namespace stipple
