#pragma once

#include <cstdint>
#include <string>

#include "base/default_init_vector.h"

namespace stipple {

/// One named channel of an image with layers.
struct ImageChannel {
  std::string name;  ///< "ViewLayer.Combined.R", UTF-8
  uint32_t width = 0;
  uint32_t height = 0;
  DefaultInitVector<float> values;  ///< [height,width], row 0 = top
};

}  // namespace stipple
