#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace stipple {

struct LocalRadiusOptions {
  size_t neighbours = 49;  ///< fewer where there are fewer splats
  double factor = 1.2;
};

/// How far apart splats stand around each one: the mean of the distances d_1 <= d_2 <= ... to its
/// neighbours, times `factor`, weighted by exp(-((d_j - d_1) / h)^2), h the median of d_1 over all
/// splats. Where most splats have a twin (h = 0) all neighbours weigh the same.
/// In: positions [N,3]; those beyond 1e15 count as there. Out: [N]; nothing for fewer than two.
/// Cost: O(N log N), 49 neighbours of each.
std::vector<double> localRadii(std::span<const float> positions,
                               const LocalRadiusOptions& options = {});

}  // namespace stipple
