#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Parts of a file as one cloud, in their order; harmonics above a part's degree are zero. What is
/// not per splat (colour space, filter, frame) is the first part's. In: at least one part.
SplatCloud joined(const std::vector<SplatCloud>& parts);

/// Some splats of a cloud. In: indices [count], each below the cloud's size.
SplatCloud gathered(const SplatCloud& cloud, const uint32_t* indices, size_t count);

/// Orders splats along the Morton curve through their bounds, equal codes by index, so that
/// neighbours in a file are neighbours in space. In and out: indices [count] into positions [.,3].
void sortAlongMortonCurve(const std::vector<float>& positions, uint32_t* indices, size_t count);

}  // namespace stipple
