#pragma once

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// The same splats with harmonics up to another degree: what is beyond it is cut off, and what is
/// not there is 0. In: degree 0..kMaxShDegree.
SplatCloud withShDegree(const SplatCloud& cloud, int degree);

}  // namespace stipple
