#include "data/views/rgba_picture.h"

#include <algorithm>

#include "math/empty_depth.h"

namespace stipple {

void takeRgba(const float* rgba, ViewPicture& picture) {
  const size_t pixels = size_t{picture.width} * picture.height;
  picture.colour.resize(pixels * 3);
  picture.alpha.resize(pixels);
  bool opaque = true;
  for (size_t i = 0; i < pixels; ++i) {
    std::copy(rgba + i * 4, rgba + i * 4 + 3, &picture.colour[i * 3]);
    picture.alpha[i] = rgba[i * 4 + 3];
    opaque = opaque && picture.alpha[i] == 1.0f;
  }
  if (opaque) picture.alpha.clear();
}

void giveRgba(const ViewPicture& picture, float* rgba) {
  const size_t pixels = size_t{picture.width} * picture.height;
  for (size_t i = 0; i < pixels; ++i) {
    std::copy_n(&picture.colour[i * 3], 3, rgba + i * 4);
    rgba[i * 4 + 3] = picture.alpha.empty() ? 1.0f : picture.alpha[i];
  }
}

void forgetEmptyDepth(ViewPicture& picture) {
  for (float& depth : picture.depth) {
    if (depth >= kEmptyDepth) depth = 0.0f;
  }
}

}  // namespace stipple
