#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "math/camera.h"
#include "train/backend/backend_factory.h"

namespace stipple {

/// How much of each splat is seen: over all views, what it adds to the pictures (the sum of T
/// alpha, the rasteriser's blending weight) over what it would add with nothing in front. In:
/// cloud, views. Returns: [N] 0..1; 1 for splats that stand in no view, 0 for those too faint to
/// show. Same values for any number of threads. Cost: one backward pass per view.
std::vector<float> splatVisibility(const BackendFactory& backends, const SplatCloud& cloud,
                                   std::span<const Camera> views, Progress* progress = nullptr);

/// Upper bound of the bytes that splatVisibility allocates for views of this many pixels per side,
/// the result included.
uint64_t visibilityMemoryBound(const BackendFactory& backends, const SplatCloud& cloud,
                               uint32_t view_size);

}  // namespace stipple
