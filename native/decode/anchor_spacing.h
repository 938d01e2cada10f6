#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "density/anchor_sampling.h"

namespace stipple {

/// How far apart anchors stand, unit cube: the root of the area that an anchor has to itself, were
/// they strewn on a plane: from the squared distances of the nearest six, whose means are i / pi
/// areas for the i-th. At most half a cube, which a single anchor has; at least a quarter of a
/// leaf, or less where more than 16 share a leaf (anchors without jitter stand on each other).
/// Threads and determinism: parallel; same result for any number of threads. Cost: O(P log P).
std::vector<float> anchorSpacing(const AnchorSet& anchors);

/// The same, with the neighbours that it found. Out: neighbours [P, kSpacingNeighbours] nearest
/// anchors, kNoPlace (decode/tree/merge_neighbours.h) where there are fewer.
constexpr size_t kSpacingNeighbours = 6;
std::vector<float> anchorSpacing(const AnchorSet& anchors, std::vector<uint32_t>& neighbours);
/// Bytes that it holds for each anchor: places as double and float, a tree, neighbours.
constexpr uint64_t kSpacingBytes = 3 * 12 + 64 + 7 * sizeof(uint32_t);

/// Units of SplatLayout. In: side of the lattice that the splats of a unit of 1 fill: splats are
/// then as large as their anchors stand apart; 0: units are 1, whatever the budget is.
std::vector<float> lengthUnits(const AnchorSet& anchors, float side);

}  // namespace stipple
