#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "splat/edit/region.h"

namespace stipple {

/// The selection [N] (0, 1) after regions in order. A splat lies where its centre does, in double.
/// In: a cloud that validate() accepts; only its sizes are looked at, since a stroke has no time
/// for more. before [N]: anything but 0 is selected. Errors: kInvalidArgument for a mask of another
/// length, a path without points, an outline of fewer than three, more points than are allowed,
/// numbers that are not finite or beyond 1e30, a negative radius or tolerance, a box that
/// validateAffine() refuses, an image of depths without size or with NaN. Determinism: any number
/// of threads. Cost: O(N) for each region; kGrow: mesh/point_growth.h.
std::vector<uint8_t> selectedByRegions(const SplatCloud& cloud, std::span<const Region> regions,
                                       std::span<const uint8_t> before);

/// What kColour compares: the colours of degree 0 of splats [n], linear Rec.709. [n,3]
/// Errors: kInvalidArgument for an index that the cloud does not have.
std::vector<double> baseColours(const SplatCloud& cloud, std::span<const uint64_t> splats);

}  // namespace stipple
