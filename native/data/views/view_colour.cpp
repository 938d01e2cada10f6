#include "data/views/view_colour.h"

#include <algorithm>

#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kPixelsPerTask = 16384;

/// Colours of `count` pixels, and their alpha or null; strides in values.
struct Pixels {
  float* colour = nullptr;
  size_t stride = 0;
  size_t channels = 0;
  const float* alpha = nullptr;
  size_t alpha_stride = 0;
  size_t count = 0;
};

void convert(const Pixels& pixels, bool to_display) {
  parallelFor(pixels.count, kPixelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = pixels.colour + i * pixels.stride;
      const float covered = pixels.alpha ? pixels.alpha[i * pixels.alpha_stride] : 1.0f;
      const float alpha = covered > 0.0f ? covered : 1.0f;
      for (size_t c = 0; c < pixels.channels; ++c) {
        const float straight = pixel[c] / alpha;
        pixel[c] = (to_display ? linearToSrgb(straight) : srgbToLinear(straight)) * alpha;
      }
    }
  });
}

bool areEqual(Transfer from, ColourSpace to) {
  return (from == Transfer::kSrgb) == (to == ColourSpace::kDisplay);
}

}  // namespace

void convertColours(ViewPicture& picture, Transfer from, ColourSpace to) {
  if (areEqual(from, to)) return;
  convert({picture.colour.data(), 3, 3, picture.alpha.empty() ? nullptr : picture.alpha.data(), 1,
           picture.colour.size() / 3},
          to == ColourSpace::kDisplay);
}

void convertColours(Image& image, ColourSpace to) {
  if (areEqual(image.transfer, to)) return;
  const bool has_alpha = image.channels == 4;
  convert({image.pixels.data(), image.channels, std::min<size_t>(image.channels, 3),
           has_alpha ? image.pixels.data() + 3 : nullptr, image.channels, image.pixelCount()},
          to == ColourSpace::kDisplay);
  image.transfer = to == ColourSpace::kDisplay ? Transfer::kSrgb : Transfer::kLinear;
}

}  // namespace stipple
