#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "density/anchor_sampling.h"

namespace stipple {

/// Anchors that may be near a place: the order of leaves is a grid of any width of cells, as the
/// anchors of an octree's cell stand behind each other.
/// In: anchors in the order of their leaves, which hold their positions; radius >= 0, unit cube.
/// Out: ranges [first, last) that together hold, once each, all anchors within the radius of anchor
/// i, it too, and none farther than 4 radii and two leaves along any axis.
/// Cost: O(log P) for each of at most eight ranges.
void anchorsAround(const AnchorSet& anchors, size_t i, double radius,
                   std::vector<std::pair<uint32_t, uint32_t>>& ranges);

}  // namespace stipple
