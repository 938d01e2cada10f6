#pragma once

#include <cstdint>
#include <span>

#include "base/progress.h"
#include "decode/tree/merge_tree.h"
#include "decode/tree/moving_node.h"
#include "decode/tree/tree_shape.h"
#include "motion/motion_cloud.h"

namespace stipple {

/// A tree over splats that move. Each inner node is itself a splat that moves: what its leaves were
/// merged into, at all times.
struct MovingTree : TreeShape {
  MotionCloud nodes;  ///< [N-1] inner nodes
};

struct MovingTreeOptions : MergeTreeOptions {
  /// Times of the clip at which merges are judged, 1..kMostMergeTimes; no more than the clip has
  /// frames. Raising it tells apart paths and lives that differ for a shorter while.
  size_t times = kMergeTimes;
};

/// Builds the tree as buildMergeTree() does, with what merges do to images summed over the clip: a
/// cut is good at all times, and the same at all times.
/// In: leaves: what validate() accepts, at least one splat. visibility [N] 0..1, the mean over the
/// clip, or empty: 1 everywhere. Errors: kInvalidArgument as of buildMergeTree(); kCancelled. Same
/// tree for any number of threads and on every processor.
/// Cost: O(N log N), about 30 us per splat on two threads.
MovingTree buildMovingTree(const MotionCloud& leaves, std::span<const float> visibility,
                           const MovingTreeOptions& options, Progress* progress = nullptr);

/// Upper bound of the bytes that buildMovingTree allocates, the tree included.
uint64_t movingTreeMemoryBound(uint64_t leaf_count, int sh_degree);

/// Refuses a tree that does not fit the leaves. `what` names it. Errors: kInvalidArgument.
void validateTree(const MovingTree& tree, const MotionCloud& leaves, const char* what);

}  // namespace stipple
