#include "mesh/point_components.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/parallel.h"
#include "base/random.h"
#include "mesh/joined_groups.h"
#include "mesh/point_tree.h"

namespace stipple {

namespace {

/// Integer cell coordinates, as doubles: far points have cells beyond any integer type.
using Cell = std::array<double, 3>;

/// Points sorted into cells so small that all points of a cell are neighbours.
class CellGrid {
 public:
  CellGrid(std::span<const float> points, double side) : side_(side) {
    const size_t count = points.size() / 3;
    std::vector<Cell> cells(count);
    for (size_t i = 0; i < count; ++i) cells[i] = cellOf(&points[i * 3]);
    order_.resize(count);
    std::iota(order_.begin(), order_.end(), 0u);
    std::sort(order_.begin(), order_.end(), [&](uint32_t a, uint32_t b) {
      return cells[a] != cells[b] ? cells[a] < cells[b] : a < b;
    });
    for (size_t i = 0; i < count; ++i) {
      const Cell& cell = cells[order_[i]];
      if (i == 0 || cell != cells_.back()) {
        cells_.push_back(cell);
        begins_.push_back(static_cast<uint32_t>(i));
      }
    }
    begins_.push_back(static_cast<uint32_t>(count));
    slots_.assign(std::bit_ceil(cells_.size() * 2 + 1), kEmpty);
    for (uint32_t c = 0; c < cells_.size(); ++c) {
      size_t slot = slotOf(cells_[c]);
      while (slots_[slot] != kEmpty) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = c;
    }
  }

  static constexpr uint32_t kEmpty = UINT32_MAX;
  size_t size() const { return cells_.size(); }
  const Cell& cell(size_t c) const { return cells_[c]; }
  std::span<const uint32_t> pointsOf(size_t c) const {
    return std::span(order_).subspan(begins_[c], begins_[c + 1] - begins_[c]);
  }
  uint32_t find(const Cell& cell) const {
    size_t slot = slotOf(cell);
    while (slots_[slot] != kEmpty && cells_[slots_[slot]] != cell) {
      slot = (slot + 1) & (slots_.size() - 1);
    }
    return slots_[slot];
  }

 private:
  Cell cellOf(const float* point) const {
    Cell cell;
    // + 0.0 makes -0 of 0, so that equal cells have equal bits.
    for (size_t k = 0; k < 3; ++k)
      cell[k] = std::floor(static_cast<double>(point[k]) / side_) + 0.0;
    return cell;
  }
  size_t slotOf(const Cell& cell) const {
    uint64_t hash = 0;
    for (const double value : cell) hash = mixBits(hash ^ std::bit_cast<uint64_t>(value + 0.0));
    return static_cast<size_t>(hash) & (slots_.size() - 1);
  }

  double side_;
  std::vector<uint32_t> order_;
  std::vector<Cell> cells_;
  std::vector<uint32_t> begins_;
  std::vector<uint32_t> slots_;
};

/// Half of the cells that can hold neighbours of a cell's points, nearest first. With cells of
/// radius / sqrt 3 those are at most 2 away along each axis.
std::vector<std::array<int, 3>> halfOfNeighbours() {
  std::vector<std::array<int, 3>> offsets;
  for (int x = -2; x <= 2; ++x) {
    for (int y = -2; y <= 2; ++y) {
      for (int z = -2; z <= 2; ++z) {
        if (std::array{x, y, z} > std::array{0, 0, 0}) offsets.push_back({x, y, z});
      }
    }
  }
  std::stable_sort(offsets.begin(), offsets.end(), [](const auto& a, const auto& b) {
    const auto squared = [](const auto& o) { return o[0] * o[0] + o[1] * o[1] + o[2] * o[2]; };
    return squared(a) < squared(b);
  });
  return offsets;
}

/// Whether any point of one list is within the radius of any point of another.
bool anyWithin(std::span<const float> points, std::span<const uint32_t> a,
               std::span<const uint32_t> b, double squared_radius) {
  constexpr size_t kBruteForce = 4096;
  if (a.size() > b.size()) std::swap(a, b);
  std::optional<PointTree> tree;
  const PointRows rows{points, b};
  if (a.size() * b.size() > kBruteForce) {
    tree.emplace(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  }
  for (const uint32_t i : a) {
    const float* p = &points[size_t{i} * 3];
    if (tree) {
      uint32_t nearest = 0;
      double squared = 0;
      if (tree->knnSearch(p, 1, &nearest, &squared) == 1 && squared <= squared_radius) return true;
      continue;
    }
    for (const uint32_t j : b) {
      double squared = 0;
      for (size_t k = 0; k < 3; ++k) {
        const double d = static_cast<double>(p[k]) - static_cast<double>(points[size_t{j} * 3 + k]);
        squared += d * d;
      }
      if (squared <= squared_radius) return true;
    }
  }
  return false;
}

}  // namespace

std::vector<uint32_t> pointComponents(std::span<const float> points, double radius,
                                      Progress* progress) {
  const size_t count = points.size() / 3;
  std::vector<uint32_t> result(count);
  if (count == 0) return result;
  // A hair less than radius / sqrt 3: rounding must not put points into one cell that are further
  // apart than the radius.
  const CellGrid grid(points, radius * (0.57735026918962573 * (1 - 1e-12)));
  const std::vector<std::array<int, 3>> offsets = halfOfNeighbours();
  JoinedGroups groups(count);
  for (size_t c = 0; c < grid.size(); ++c) {
    const std::span<const uint32_t> here = grid.pointsOf(c);
    for (const uint32_t i : here) groups.join(here[0], i);
  }
  for (size_t c = 0; c < grid.size(); ++c) {
    if (c % 4096 == 0) {
      advance(progress, static_cast<double>(c) / static_cast<double>(grid.size()),
              "Connecting splats");
    }
    const std::span<const uint32_t> here = grid.pointsOf(c);
    for (const std::array<int, 3>& offset : offsets) {
      Cell cell = grid.cell(c);
      for (size_t k = 0; k < 3; ++k) cell[k] += offset[k];
      const uint32_t other = grid.find(cell);
      if (other == CellGrid::kEmpty || other == c) continue;
      const std::span<const uint32_t> there = grid.pointsOf(other);
      if (groups.root(here[0]) == groups.root(there[0])) continue;
      if (anyWithin(points, here, there, radius * radius)) groups.join(here[0], there[0]);
    }
  }
  for (uint32_t i = 0; i < count; ++i) result[i] = groups.root(i);
  return result;
}

std::vector<double> neighbourDistances(std::span<const float> points,
                                       std::span<const uint32_t> queries, size_t k) {
  const size_t count = points.size() / 3;
  std::vector<double> result(queries.size(), 0.0);
  if (count < 2) return result;
  std::vector<uint32_t> all(count);
  std::iota(all.begin(), all.end(), 0u);
  const PointRows rows{points, all};
  PointTree tree(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  const size_t wanted = std::min(k + 1, count);  // the point itself is among them
  parallelFor(queries.size(), 256, [&](size_t begin, size_t end) {
    std::vector<uint32_t> indices(wanted);
    std::vector<double> squared(wanted);
    for (size_t i = begin; i < end; ++i) {
      const size_t found =
          tree.knnSearch(&points[size_t{queries[i]} * 3], wanted, indices.data(), squared.data());
      result[i] = std::sqrt(squared[found - 1]);
    }
  });
  return result;
}

}  // namespace stipple
