#pragma once

#include <cstdint>
#include <vector>

#include "data/clouds/splat_cloud.h"
#include "density/anchor_sampling.h"

namespace stipple {

/// Which splats of a small budget those of a larger one come from.
struct SplatGrowth {
  /// [N] of each splat of the larger budget, the one of the smaller budget that it is or lies
  /// nearest to.
  std::vector<uint32_t> sources;
  /// [N] 1: it is that splat, with another size; 0: it appears beside it. Each of the smaller
  /// budget is at most one of the larger.
  std::vector<uint8_t> stays;
};

/// By anchors that both budgets have, and by the nearest of the smaller budget for all others.
/// In: the anchors of the smaller and of the larger budget and what a decoder made of them, K
/// splats each. Cost: O(N log N). Same result for any number of threads.
SplatGrowth growthOfAnchors(const AnchorSet& few, const SplatCloud& few_splats,
                            const AnchorSet& many, const SplatCloud& many_splats);

/// Row `o` of `out`: splat i of `many` on its way from splat s of `few`. In: stays, along: as
/// below; `out` of the same degree, and it may be `few` with o = s.
void putGrown(const SplatCloud& few, size_t s, const SplatCloud& many, size_t i, bool stays,
              double along, SplatCloud& out, size_t o);

/// Splats between two budgets. In: along 0..1: 0 shows the smaller budget (splats that appear have
/// opacity 0), 1 the larger one. Those that stay go from one shape, colour and place to the other;
/// those that appear go from between their place and their source to their place, and grow from
/// nothing. Shapes go by logarithms of lengths; axes are paired by direction, so that a long axis
/// that becomes the short one does not turn. Continuous in `along`. Cost: O(N).
SplatCloud grownSplats(const SplatCloud& few, const SplatCloud& many, const SplatGrowth& growth,
                       double along);

}  // namespace stipple
