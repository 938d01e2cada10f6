#pragma once

#include <cstddef>
#include <cstdint>

#include "data/clouds/splat_cloud.h"
#include "math/camera.h"

namespace stipple::bench {

struct SplatCase {
  const char* name;
  size_t splats;
  uint32_t width, height;
  int degree;
  double size;      ///< median standard deviation, times 1/sqrt(splats) of the ball's radius
  float faint = 1;  ///< opacities times this
};

/// Splats in a ball, as fitted scenes have them: flat-ish, many faint, log-normal sizes. Made once.
const SplatCloud& cloudOf(const SplatCase& c);

Camera cameraOf(const SplatCase& c);

}  // namespace stipple::bench
