#pragma once

#include <array>

#include "data/images/image.h"

namespace stipple {

/// Bilinear reader of a texture with repeat wrap. Display-space texels are made linear before they
/// are filtered. The picture must outlive the reader; it may be shared by threads.
class TextureLookup {
 public:
  explicit TextureLookup(const Image& image);
  /// In: u, v (v = 0 at the bottom of the picture), any finite value.
  /// Out: scene linear RGB and straight alpha (1 where the picture has none).
  std::array<float, 4> at(float u, float v) const;
  uint32_t width() const { return image_->width; }
  uint32_t height() const { return image_->height; }

 private:
  const Image* image_;
};

}  // namespace stipple
