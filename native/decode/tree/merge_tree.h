#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "decode/tree/tree_shape.h"

namespace stipple {

/// A tree over the splats of a cloud. Each inner node is what its leaves were merged into.
struct MergeTree : TreeShape {
  SplatCloud nodes;  ///< [N-1] inner nodes
};

struct MergeTreeOptions {
  /// Standard deviation of the low-pass through which errors are seen, metres: about half a pixel
  /// where the cloud fills a picture. Raising it makes what is smaller than it cheap to merge.
  /// 0: 1/1400 of the cloud's extent, half a pixel of a picture of 800.
  double footprint = 0;
};

/// Builds the tree bottom-up: neighbours that are each other's cheapest partner merge, round by
/// round.
/// In: leaves: a cloud that validate() accepts, at least one splat. visibility [N] 0..1, how much
/// of a splat is seen on average (train/loop/visibility.h), or empty: 1 everywhere. Errors:
/// kInvalidArgument for an empty cloud, sizes that disagree, values outside 0..1. Same tree for any
/// number of threads. Cost: O(N log N), about 3 us per splat on two threads.
MergeTree buildMergeTree(const SplatCloud& leaves, std::span<const float> visibility,
                         const MergeTreeOptions& options, Progress* progress = nullptr);

/// Upper bound of the bytes that buildMergeTree allocates, the tree included.
uint64_t mergeTreeMemoryBound(uint64_t leaf_count, int sh_degree);

/// Refuses a tree that does not fit the leaves: counts, parents out of order or with other than two
/// children, errors that rise. `what` names it. Errors: kInvalidArgument.
void validateTree(const MergeTree& tree, const SplatCloud& leaves, const char* what);

}  // namespace stipple
