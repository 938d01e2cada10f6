#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "splat/cpu/projector.h"
#include "splat/cpu/reused_array.h"
#include "splat/scene.h"

namespace stipple {

/// The splats that can show, in the order of blending: front to back by depthKey, ties by splat
/// index. They lie in memory in that order too, since every later step walks them in it.
struct VisibleSplats {
  ReusedArray<VisibleSplat> splats;
  const TileSpan* spans = nullptr;  ///< [count]; lies in one of `items`
  size_t count = 0;

  // What finding them needs; kept for the next picture.
  ReusedArray<VisibleSplat> slots;  ///< as projected, by range of splats
  ReusedArray<TileSpan> slot_spans;
  ReusedArray<DepthItem> items[2];
  std::vector<uint32_t> filled;  ///< visible splats of each range
  std::vector<uint32_t> digits;  ///< [chunk][digit] of the sort
};

/// Projects, culls and sorts. Same result for any number of threads. Cost: O(splats).
/// Errors: as refuseCloud, for a scene of placeSceneUnread.
VisibleSplats findVisibleSplats(const PlacedScene& scene, Progress* progress);

/// The same with a given projector into memory that may hold an earlier picture's.
void findVisibleSplats(Projector project, const PlacedScene& scene, Progress* progress,
                       VisibleSplats& visible);

/// Bytes that findVisibleSplats allocates at most.
uint64_t visibleSplatsMemoryBound(uint64_t splat_count);

}  // namespace stipple
