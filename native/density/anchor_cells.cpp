#include "density/anchor_cells.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/morton.h"

namespace stipple {

void anchorsAround(const AnchorSet& anchors, size_t i, double radius,
                   std::vector<std::pair<uint32_t, uint32_t>>& ranges) {
  ranges.clear();
  // The finest cells of which the ball touches at most two along each axis.
  int level = anchors.leaf_level;
  while (level > 0 && std::ldexp(1.0, -level) < 2 * radius) --level;
  const double cells = std::ldexp(1.0, level);
  std::array<uint32_t, 3> first, last;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto place = static_cast<double>(anchors.positions[i * 3 + axis]);
    const auto cellOf = [cells](double x) {
      return static_cast<uint32_t>(std::clamp(std::floor(x * cells), 0.0, cells - 1));
    };
    first[axis] = cellOf(place - radius);
    last[axis] = cellOf(place + radius);
  }
  const int below = 3 * (anchors.leaf_level - level);
  const auto begin = anchors.leaves.begin();
  for (uint32_t z = first[2]; z <= last[2]; ++z) {
    for (uint32_t y = first[1]; y <= last[1]; ++y) {
      for (uint32_t x = first[0]; x <= last[0]; ++x) {
        const uint64_t cell = mortonEncode(x, y, z);
        const auto from = std::lower_bound(begin, anchors.leaves.end(), cell << below);
        const auto to = std::lower_bound(from, anchors.leaves.end(), (cell + 1) << below);
        if (from == to) continue;
        ranges.emplace_back(static_cast<uint32_t>(from - begin), static_cast<uint32_t>(to - begin));
      }
    }
  }
}

}  // namespace stipple
