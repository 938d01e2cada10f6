#include "decode/anchor_spacing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "decode/tree/merge_neighbours.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 4096;
constexpr double kWidest = 0.5;

/// Anchors in the leaf of each, which stand beside each other.
std::vector<uint32_t> sharers(const AnchorSet& anchors) {
  std::vector<uint32_t> counts(anchors.size());
  for (size_t begin = 0; begin < anchors.size();) {
    size_t end = begin;
    while (end < anchors.size() && anchors.leaves[end] == anchors.leaves[begin]) ++end;
    std::fill(counts.begin() + static_cast<ptrdiff_t>(begin),
              counts.begin() + static_cast<ptrdiff_t>(end), static_cast<uint32_t>(end - begin));
    begin = end;
  }
  return counts;
}

}  // namespace

std::vector<float> anchorSpacing(const AnchorSet& anchors) {
  std::vector<uint32_t> neighbours;
  return anchorSpacing(anchors, neighbours);
}

std::vector<float> lengthUnits(const AnchorSet& anchors, float side) {
  if (side == 0) return std::vector<float>(anchors.size(), 1.0f);
  std::vector<float> units = anchorSpacing(anchors);
  for (float& unit : units) unit /= side;
  return units;
}

std::vector<float> anchorSpacing(const AnchorSet& anchors, std::vector<uint32_t>& neighbours) {
  const size_t count = anchors.size();
  const double leaf = std::ldexp(1.0, -anchors.leaf_level);
  const std::vector<double> places(anchors.positions.begin(), anchors.positions.end());
  neighbours = nearestNeighbours(places, kSpacingNeighbours);
  const std::vector<uint32_t> in_leaf = sharers(anchors);
  std::vector<float> spacing(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double squared = 0;
      double areas = 0;
      for (size_t k = 0; k < kSpacingNeighbours; ++k) {
        const uint32_t other = neighbours[i * kSpacingNeighbours + k];
        if (other == kNoPlace) break;
        for (size_t axis = 0; axis < 3; ++axis) {
          const double d = places[i * 3 + axis] - places[other * size_t{3} + axis];
          squared += d * d;
        }
        areas += static_cast<double>(k + 1) / std::numbers::pi;
      }
      const double least = leaf / std::sqrt(std::max<double>(in_leaf[i], 16));
      const double side = areas == 0 ? kWidest : std::sqrt(squared / areas);
      spacing[i] = static_cast<float>(std::clamp(side, least, kWidest));
    }
  });
  return spacing;
}

}  // namespace stipple
