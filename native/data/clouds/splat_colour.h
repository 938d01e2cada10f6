#pragma once

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Gives a cloud colours of the other space. The base colour is converted exactly; harmonics above
/// degree 0 to first order around it, by the slope of the transfer function. Pictures of
/// overlapping splats differ: compositing happens in the space of the colours.
/// Cost: O(N), all threads.
void convertColours(SplatCloud& cloud, ColourSpace to);

}  // namespace stipple
