#pragma once

#include <cstddef>

#include "base/default_init_vector.h"

namespace stipple {

/// What a layer of a convolutional network sees: `channels` numbers for each pixel.
struct FeatureMap {
  size_t height = 0;
  size_t width = 0;
  size_t channels = 0;
  DefaultInitVector<float> values;  ///< [height, width, channels]

  size_t pixelCount() const { return height * width; }
  /// Values of a map of that size, not initialised.
  static FeatureMap ofSize(size_t height, size_t width, size_t channels) {
    FeatureMap map = {height, width, channels, {}};
    map.values.resize(height * width * channels);
    return map;
  }
};

}  // namespace stipple
