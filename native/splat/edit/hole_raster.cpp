#include "splat/edit/hole_raster.h"

#include <algorithm>
#include <array>

namespace stipple {

namespace {

using Cell = HoleRaster::Cell;

/// Share of what the cells around one have inside, above which a cell without splats of its own
/// lies inside, too: along a straight edge, the first cell outside has a quarter.
constexpr float kInside = 0.3f;
/// Splats close above the ground beside those of the ground, from which on something stands there.
constexpr float kThings = 0.5f;
/// Share of a cell from which on it looks covered.
constexpr float kCovered = 0.5f;
constexpr float kWeights = 16;  ///< of blurred(), together
/// Empty cells that hang together by chance.
constexpr size_t kChance = 6;

/// Sums with the weights 1 2 1 along both axes; integers, and so exact.
std::vector<float> blurred(const HoleRaster& raster, const std::vector<float>& values) {
  std::vector<float> rows(values.size()), result(values.size());
  const size_t width = raster.width;
  for (size_t i = 0; i < values.size(); ++i) {
    const size_t column = i % width;
    rows[i] = 2 * values[i] + (column > 0 ? values[i - 1] : 0.0f) +
              (column + 1 < width ? values[i + 1] : 0.0f);
  }
  for (size_t i = 0; i < values.size(); ++i) {
    result[i] = 2 * rows[i] + (i >= width ? rows[i - width] : 0.0f) +
                (i + width < values.size() ? rows[i + width] : 0.0f);
  }
  return result;
}

/// The blurred number that cells inside have: the mean of those that have any, 1 where none has.
float usual(const std::vector<float>& counts) {
  double sum = 0, occupied = 0;
  for (const float count : counts) {
    sum += static_cast<double>(count);
    occupied += count > 0 ? 1 : 0;
  }
  return sum > 0 ? kWeights * static_cast<float>(sum / occupied) : 1;
}

/// The up to 8 cells around one.
template <class Visit>
void forNeighbours(const HoleRaster& raster, size_t cell, const Visit& visit) {
  const size_t column = cell % raster.width, row = cell / raster.width;
  for (size_t y = row > 0 ? row - 1 : 0; y <= std::min(row + 1, raster.height - 1); ++y) {
    for (size_t x = column > 0 ? column - 1 : 0; x <= std::min(column + 1, raster.width - 1); ++x) {
      if (x != column || y != row) visit(y * raster.width + x);
    }
  }
}

bool isAtBorder(const HoleRaster& raster, size_t cell) {
  const size_t column = cell % raster.width, row = cell / raster.width;
  return column == 0 || row == 0 || column + 1 == raster.width || row + 1 == raster.height;
}

/// Empty cells that hang together become a hole where they touch one and do not reach the border;
/// so few of them that chance can have left them empty, where more of a hole than of ground is
/// around them.
void closeSurrounded(HoleRaster& raster) {
  std::vector<uint8_t> visited(raster.size(), 0);
  std::vector<size_t> group;
  for (size_t start = 0; start < raster.size(); ++start) {
    if (visited[start] || raster.cells[start] != Cell::kEmpty) continue;
    group.assign(1, start);
    visited[start] = 1;
    bool open = false;
    size_t hole = 0, solid = 0;
    for (size_t k = 0; k < group.size(); ++k) {
      open |= isAtBorder(raster, group[k]);
      forNeighbours(raster, group[k], [&](size_t next) {
        if (raster.cells[next] == Cell::kHole) ++hole;
        if (raster.cells[next] == Cell::kSolid) ++solid;
        if (visited[next] || raster.cells[next] != Cell::kEmpty) return;
        visited[next] = 1;
        group.push_back(next);
      });
    }
    if (open || hole == 0 || (group.size() <= kChance && hole <= solid)) continue;
    for (const size_t cell : group) raster.cells[cell] = Cell::kHole;
  }
}

}  // namespace

size_t HoleRaster::cellAt(double u, double v) const {
  const size_t column = std::min(width - 1, static_cast<size_t>(std::max(0.0, (u - u0) / side)));
  const size_t row = std::min(height - 1, static_cast<size_t>(std::max(0.0, (v - v0) / side)));
  return row * width + column;
}

bool HoleRaster::has(double u, double v) const {
  return u >= u0 && v >= v0 && u < u0 + side * static_cast<double>(width) &&
         v < v0 + side * static_cast<double>(height);
}

size_t HoleRaster::count(Cell kind) const {
  return static_cast<size_t>(std::count(cells.begin(), cells.end(), kind));
}

void labelCells(HoleRaster& raster, const HoleCounts& counts) {
  const std::vector<float> left = blurred(raster, counts.left);
  const std::vector<float> removed = blurred(raster, counts.removed);
  const std::vector<float> above = blurred(raster, counts.above);
  const std::vector<float> things = blurred(raster, counts.things);
  const float usual_left = usual(counts.left), usual_removed = usual(counts.removed);
  const float usual_above = usual(counts.above);
  std::vector<uint8_t> thin(raster.size(), 0);  // nothing of its own and little beside it
  raster.cells.assign(raster.size(), Cell::kEmpty);
  for (size_t i = 0; i < raster.size(); ++i) {
    // A cell without splats of its own was part of what is beside it where that is most of it.
    const bool was_ground = counts.removed[i] > 0 || removed[i] >= kInside * usual_removed;
    const bool was_below = counts.above[i] > 0 || above[i] >= kInside * usual_above;
    const bool is_more = removed[i] > left[i];
    // Things have splats above each other: only shares of what is usual can be compared.
    thin[i] = counts.left[i] == 0 && left[i] < kInside * usual_left ? 1 : 0;
    const bool is_nearer = thin[i] && above[i] / usual_above > left[i] / usual_left;
    const bool is_bare =
        left[i] > 0 && counts.left_cover[i] < kCovered && counts.removed_cover[i] >= kCovered;
    if ((is_more && was_ground) || (is_nearer && was_below) || is_bare) {
      raster.cells[i] = Cell::kHole;
    } else if (left[i] > 0) {
      raster.cells[i] = things[i] > kThings * left[i] ? Cell::kThing : Cell::kSolid;
    }
  }
  closeSurrounded(raster);
  std::vector<size_t> rim;
  for (size_t i = 0; i < raster.size(); ++i) {
    if (!thin[i] || raster.cells[i] != Cell::kSolid) continue;
    bool touches = false;
    forNeighbours(raster, i, [&](size_t next) { touches |= raster.cells[next] == Cell::kHole; });
    if (touches) rim.push_back(i);
  }
  for (const size_t cell : rim) raster.cells[cell] = Cell::kHole;
}

}  // namespace stipple
