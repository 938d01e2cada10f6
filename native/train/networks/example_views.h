#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"

// What examples that are compared with views have in common.

namespace stipple {

/// Of `count` views, `wanted` different ones, keyed by the seed, in the order in which they are
/// drawn; all where there are no more.
std::vector<size_t> drawnViews(size_t count, size_t wanted, uint64_t seed);

/// Derivatives by the stored values of a cloud that are all 0.
SplatCloud zerosLike(const SplatCloud& cloud);
/// Adds `factor` times the derivatives that a view gave.
void addCloud(const SplatCloud& of_view, double factor, SplatCloud& sum);

}  // namespace stipple
