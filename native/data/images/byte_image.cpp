#include "data/images/byte_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kPixelGrain = 1 << 14;

uint8_t toByte(float value) {
  // Not a number becomes 0.
  return static_cast<uint8_t>(std::lround(255.0f * std::min(std::max(0.0f, value), 1.0f)));
}

}  // namespace

ByteImage toByteImage(const Image& image) {
  ByteImage bytes = {image.width, image.height, image.channels, {}};
  bytes.pixels.resize(image.pixels.size());
  const bool has_alpha = image.channels == 4;
  const size_t colours = has_alpha ? 3 : image.channels;
  parallelFor(image.pixelCount(), kPixelGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* from = image.pixels.data() + i * image.channels;
      uint8_t* to = bytes.pixels.data() + i * image.channels;
      const float alpha = has_alpha ? from[3] : 1.0f;
      for (size_t c = 0; c < colours; ++c) {
        float value = alpha > 0.0f ? from[c] / alpha : 0.0f;
        if (image.transfer == Transfer::kLinear) value = linearToSrgb(value);
        to[c] = toByte(value);
      }
      if (has_alpha) to[3] = toByte(alpha);
    }
  });
  return bytes;
}

ByteImage toMask(const ByteImage& image) {
  if (image.channels == 1) return image;
  bool has_alpha = false;
  for (size_t i = 3; image.channels == 4 && i < image.pixels.size(); i += 4) {
    has_alpha |= image.pixels[i] < 255;
  }
  ByteImage mask = {image.width, image.height, 1, {}};
  mask.pixels.resize(image.pixelCount());
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    const uint8_t* pixel = image.pixels.data() + i * image.channels;
    const uint32_t brightness =
        (19595u * pixel[0] + 38470u * pixel[1] + 7471u * pixel[2] + 32768u) >> 16;
    mask.pixels[i] = has_alpha ? pixel[3] : static_cast<uint8_t>(brightness);
  }
  return mask;
}

void requireByteImage(const ByteImage& image, const char* what) {
  if (image.width == 0 || image.height == 0) {
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " has no pixels (" + sizeText(image.width, image.height) + ").");
  }
  if (image.channels != 1 && image.channels != 3 && image.channels != 4) {
    fail(ErrorCode::kInvalidArgument, std::string(what) + " has " + std::to_string(image.channels) +
                                          " channels; 1, 3 or 4 are allowed.");
  }
  if (image.pixels.size() != image.pixelCount() * image.channels) {
    fail(ErrorCode::kInvalidArgument,
         std::string(what) + " of " + sizeText(image.width, image.height) + " pixels with " +
             std::to_string(image.channels) + " channels has " +
             std::to_string(image.pixels.size()) + " bytes; it needs " +
             std::to_string(image.pixelCount() * image.channels) + ".");
  }
}

}  // namespace stipple
