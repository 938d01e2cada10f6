#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "splat/cpu/projector.h"
#include "splat/cpu/reused_array.h"
#include "splat/render/scene.h"

namespace stipple {

/// Splats that are projected by one task; each range begins at its own number among the slots.
/// Their inputs (up to 340 bytes each) stay in the second-level cache between the check of their
/// values and the projection.
constexpr size_t kRangeSplats = 2048;

/// The splats that can show, and the order of blending: front to back by depthKey, ties by splat
/// index. They stay in memory where they were projected, in slots by ranges of the clouds' rows,
/// which lists of tiles name: to bring them into the order of depth would read and write each once
/// more, and a tile takes splats from everywhere in either order.
struct VisibleSplats {
  ReusedArray<VisibleSplat> splats;  ///< by slot; each range of splats begins at its own number
  ReusedArray<VisibleExtra> extras;  ///< by slot
  const DepthItem* order = nullptr;  ///< [count] front to back; lies in one of `items`
  const TileSpan* spans = nullptr;   ///< [count] front to back; lies in the other
  size_t count = 0;

  /// How many slots, from `begin` on, the range that begins there has; they are in the order of the
  /// splats.
  size_t slotCount(size_t begin) const { return filled[begin / kRangeSplats]; }

  /// The slot of the splat that is `place` from the front.
  uint32_t slotAt(size_t place) const { return static_cast<uint32_t>(order[place]); }
  const VisibleSplat& at(size_t place) const { return splats[slotAt(place)]; }
  const VisibleExtra& extraAt(size_t place) const { return extras[slotAt(place)]; }
  SplatSlots slots() const { return {splats.get(), extras.get()}; }

  // What finding them needs; kept for the next picture.
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
