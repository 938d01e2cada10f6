#pragma once

#include "data/clouds/splat_cloud.h"
#include "data/latent.h"

namespace stipple {

/// Where an object stands on the origin: with the middle of its base, z up, and its largest side
/// `size` metres long. The base and the sides are those of its splats' centres but for a share of
/// outliers, and for splats that are hardly seen.
/// In: cloud, as decoded; size above 0. Out: 1 and no offset for a cloud without extent.
LatentPlacement standingOnBase(const SplatCloud& cloud, double size);

}  // namespace stipple
