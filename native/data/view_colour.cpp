#include "data/view_colour.h"

#include "base/parallel.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kPixelsPerTask = 16384;

template <typename Curve>
void applyCurve(ViewPicture& picture, const Curve& curve) {
  parallelFor(picture.colour.size() / 3, kPixelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* pixel = &picture.colour[i * 3];
      const float covered = picture.alpha.empty() ? 1.0f : picture.alpha[i];
      const float alpha = covered > 0.0f ? covered : 1.0f;
      for (size_t c = 0; c < 3; ++c) pixel[c] = curve(pixel[c] / alpha) * alpha;
    }
  });
}

}  // namespace

void convertColours(ViewPicture& picture, Transfer from, ColourSpace to) {
  const bool is_display = from == Transfer::kSrgb;
  const bool to_display = to == ColourSpace::kDisplay;
  if (is_display == to_display) return;
  if (to_display) {
    applyCurve(picture, linearToSrgb<float>);
  } else {
    applyCurve(picture, srgbToLinear<float>);
  }
}

}  // namespace stipple
