#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/progress.h"

namespace stipple {

/// Connected groups of points, any two of which at most `radius` apart are neighbours.
/// In: points [N,3] finite; radius > 0, metres.
/// Out: for each point the smallest index in its group. [N]
/// Errors: kCancelled. Determinism: the groups are those of the definition, whatever the order of
/// work. Cost: about O(N log N); points that crowd together cost no more than others.
std::vector<uint32_t> pointComponents(std::span<const float> points, double radius,
                                      Progress* progress);

/// Distance of each of `queries` (indices of points) to its k-th nearest other point; the furthest
/// one there is where there are fewer. In: k >= 1.
std::vector<double> neighbourDistances(std::span<const float> points,
                                       std::span<const uint32_t> queries, size_t k);

}  // namespace stipple
