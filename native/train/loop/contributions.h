#pragma once

#include <cstddef>
#include <vector>

#include "densify/strategy.h"

namespace stipple {

/// Views over which contributions of the result of a fit are measured, at most.
constexpr size_t kContributionViews = 16;

/// [N] pixels that each splat fills: its blending weights summed over the pixels of a view, mean of
/// `most` views that lie evenly among all (of all, where there are no more). The same for any
/// number of threads. Cost: a drawing and a backward pass for each of these views.
std::vector<float> meanContributions(ViewEvaluator& views, size_t most);

}  // namespace stipple
