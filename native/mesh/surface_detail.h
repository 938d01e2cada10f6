#pragma once

#include <vector>

#include "base/progress.h"
#include "data/meshes/point_set.h"

namespace stipple {

/// How much a place of the surface varies, 0 (flat and of one colour) to 1, per sample [N].
/// detail = x / (1 + x), x = mean(1 − n·n') / 0.02 + variance(colour') / 0.0025, over the samples
/// of the same side of the surface (n·n' > −0.2) within r = 2.5 √(area / M); colours in display
/// space, variance averaged over the channels; M = min(N, 100000) evenly chosen samples take part.
/// The result is averaged once over the same neighbourhood. Turning all normals by 0.2 rad or a
/// standard deviation of 0.05 in the colours gives 1/2. In: a set with positions, unit normals,
/// colours and areas. Same result for any thread count. Cost: O(N).
std::vector<float> surfaceDetail(const PointSet& surface, Progress* progress = nullptr);

}  // namespace stipple
