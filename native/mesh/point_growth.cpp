#include "mesh/point_growth.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "base/random.h"
#include "math/morton.h"
#include "math/radix_order.h"
#include "mesh/cell_table.h"
#include "mesh/point_tree.h"

namespace stipple {

namespace {

constexpr size_t kGrain = 16384;
constexpr size_t kNeighbour = 8;
constexpr size_t kSpacingQueries = 32;
/// Beyond so many cells along an axis, rounding could put a point into the cell beside its own.
constexpr double kMostCells = 1e12;
constexpr int kMaxLevel = 21;  ///< of Morton codes
/// Sources of a block above which a tree finds the nearest one sooner.
constexpr size_t kMostPerBlock = 48;

/// Ends a search at the first point within a distance.
class AnyWithin {
 public:
  using DistanceType = double;
  using IndexType = uint32_t;
  explicit AnyWithin(double squared)
      : above_(std::nextafter(squared, std::numeric_limits<double>::infinity())) {}
  size_t size() const { return found_ ? 1 : 0; }
  bool full() const { return true; }
  bool addPoint(double, uint32_t) {
    found_ = true;
    return false;
  }
  double worstDist() const { return above_; }
  void sort() {}  // newer releases ask for it, though nobody asks them to sort
  bool found() const { return found_; }

 private:
  double above_;
  bool found_ = false;
};

struct Box {
  std::array<double, 3> lowest, highest;  ///< lowest above highest: empty

  Box() {
    lowest.fill(std::numeric_limits<double>::infinity());
    highest.fill(-std::numeric_limits<double>::infinity());
  }
  void add(const float* p) {
    for (size_t k = 0; k < 3; ++k) {
      lowest[k] = std::min(lowest[k], static_cast<double>(p[k]));
      highest[k] = std::max(highest[k], static_cast<double>(p[k]));
    }
  }
  void add(const Box& other) {
    for (size_t k = 0; k < 3; ++k) {
      lowest[k] = std::min(lowest[k], other.lowest[k]);
      highest[k] = std::max(highest[k], other.highest[k]);
    }
  }
  void widen(double by) {
    for (size_t k = 0; k < 3; ++k) {
      lowest[k] -= by;
      highest[k] += by;
    }
  }
  bool has(const float* p) const {
    for (size_t k = 0; k < 3; ++k) {
      const double v = static_cast<double>(p[k]);
      if (v < lowest[k] || v > highest[k]) return false;
    }
    return true;
  }
};

/// The bounds of points whose mask is 0, and of the others.
std::array<Box, 2> boundsOf(std::span<const float> points, std::span<const uint8_t> mask) {
  std::vector<std::array<Box, 2>> parts(rangeCount(mask.size(), kGrain));
  parallelFor(mask.size(), kGrain, [&](size_t begin, size_t end) {
    std::array<Box, 2>& part = parts[begin / kGrain];
    for (size_t i = begin; i < end; ++i) part[mask[i]].add(&points[i * 3]);
  });
  std::array<Box, 2> bounds;
  for (const auto& part : parts) {
    bounds[0].add(part[0]);
    bounds[1].add(part[1]);
  }
  return bounds;
}

/// Indices of [0, count) that pass, in order.
template <class Passes>
std::vector<uint32_t> listOf(size_t count, const Passes& passes) {
  std::vector<std::vector<uint32_t>> parts(rangeCount(count, kGrain));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    std::vector<uint32_t>& part = parts[begin / kGrain];
    for (size_t i = begin; i < end; ++i) {
      if (passes(i)) part.push_back(static_cast<uint32_t>(i));
    }
  });
  std::vector<uint32_t> list;
  for (const auto& part : parts) list.insert(list.end(), part.begin(), part.end());
  return list;
}

using Cell = std::array<int64_t, 3>;

class CellSet {
 public:
  CellSet() : slots_(64, kNone) {}
  void insert(const Cell& cell) {
    size_t slot = slotOf(cell);
    if (slots_[slot] != kNone) return;
    slots_[slot] = cell;
    if (++size_ * 2 > slots_.size()) grow();
  }
  bool has(const Cell& cell) const { return slots_[slotOf(cell)] != kNone; }
  template <class Visit>
  void forEach(const Visit& visit) const {
    for (const Cell& cell : slots_) {
      if (cell != kNone) visit(cell);
    }
  }

 private:
  static constexpr Cell kNone = {INT64_MIN, 0, 0};

  /// Where the cell is, or would be.
  size_t slotOf(const Cell& cell) const {
    const size_t last = slots_.size() - 1;
    const auto bits = [](int64_t v) { return static_cast<uint64_t>(v); };
    uint64_t hash = bits(cell[0]) * 0x9e3779b97f4a7c15ull;
    hash = (hash ^ bits(cell[1])) * 0xbf58476d1ce4e5b9ull;
    size_t slot = static_cast<size_t>(mixBits(hash ^ bits(cell[2]))) & last;
    while (slots_[slot] != kNone && slots_[slot] != cell) slot = (slot + 1) & last;
    return slot;
  }
  void grow() {
    const std::vector<Cell> before = std::move(slots_);
    slots_.assign(before.size() * 4, kNone);
    for (const Cell& cell : before) {
      if (cell != kNone) slots_[slotOf(cell)] = cell;
    }
  }

  std::vector<Cell> slots_;
  size_t size_ = 0;
};

/// Cells so small that two points of one are surely near, and blocks of 2 x 2 x 2 of them, so large
/// that points further away than the next block surely are not.
class Lattice {
 public:
  Lattice(const Box& box, double distance)
      : corner_(box.lowest), side_(distance * (0.57735026918962573 * (1 - 1e-9))) {}
  Cell cellOf(const float* p) const {
    Cell cell;
    for (size_t k = 0; k < 3; ++k) {
      cell[k] = static_cast<int64_t>((static_cast<double>(p[k]) - corner_[k]) / side_);
    }
    return cell;
  }
  static Cell blockOf(const Cell& cell) { return {cell[0] >> 1, cell[1] >> 1, cell[2] >> 1}; }
  /// False where the box has more cells than can be told apart.
  bool isExact(const Box& box) const {
    for (size_t k = 0; k < 3; ++k) {
      if (!((box.highest[k] - box.lowest[k]) < kMostCells * side_)) return false;
    }
    return true;
  }

  /// Of the smallest grid of 2^level blocks along each axis that holds the box.
  int blockLevel(const Box& box) const {
    int level = 0;
    for (size_t k = 0; k < 3; ++k) {
      const double blocks = (box.highest[k] - box.lowest[k]) / side_ / 2 + 1;
      while (std::ldexp(1.0, level) < blocks) ++level;
    }
    return level;
  }

 private:
  std::array<double, 3> corner_;
  double side_;
};

/// The set with the 26 blocks around each of its blocks.
CellSet widened(const CellSet& blocks) {
  CellSet wide;
  blocks.forEach([&](const Cell& block) {
    for (int64_t x = -1; x <= 1; ++x) {
      for (int64_t y = -1; y <= 1; ++y) {
        for (int64_t z = -1; z <= 1; ++z) {
          wide.insert({block[0] + x, block[1] + y, block[2] + z});
        }
      }
    }
  });
  return wide;
}

/// The list along a curve through space: who asks next asks nearby, where memory is at hand.
std::vector<uint32_t> alongCurve(std::span<const float> points, const std::vector<uint32_t>& list,
                                 const Box& box) {
  constexpr double kSteps = (1 << 21) - 1;
  double extent = 0;
  for (size_t k = 0; k < 3; ++k) extent = std::max(extent, box.highest[k] - box.lowest[k]);
  const double scale = extent > 0 ? kSteps / extent : 0;
  KeyedIndices keys(list.size());
  parallelFor(list.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::array<uint32_t, 3> step;
      for (size_t k = 0; k < 3; ++k) {
        const double offset = static_cast<double>(points[size_t{list[i]} * 3 + k]) - box.lowest[k];
        step[k] = static_cast<uint32_t>(std::clamp(offset * scale, 0.0, kSteps));
      }
      keys[i] = {mortonEncode(step[0], step[1], step[2]), list[i]};
    }
  });
  sortByKey(keys);
  std::vector<uint32_t> ordered(list.size());
  for (size_t i = 0; i < list.size(); ++i) ordered[i] = keys[i].index;
  return ordered;
}

/// Sets `near` of targets that have a source within the distance.
void decideByTree(std::span<const float> points, const Box& box,
                  const std::vector<uint32_t>& given_sources,
                  const std::vector<uint32_t>& given_targets, double distance,
                  std::vector<uint8_t>& near) {
  if (given_sources.empty() || given_targets.empty()) return;
  const std::vector<uint32_t> sources = alongCurve(points, given_sources, box);
  const std::vector<uint32_t> targets = alongCurve(points, given_targets, box);
  // Packed in that order, so that a leaf's points lie together.
  std::vector<float> packed(sources.size() * 3);
  std::vector<uint32_t> all(sources.size());
  for (uint32_t i = 0; i < sources.size(); ++i) {
    all[i] = i;
    std::copy_n(&points[size_t{sources[i]} * 3], 3, &packed[size_t{i} * 3]);
  }
  const PointRows rows{packed, all};
  const PointTree tree(3, rows, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  parallelFor(targets.size(), 256, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      AnyWithin result(distance * distance);
      tree.findNeighbors(result, &points[size_t{targets[t]} * 3], {});
      if (result.found()) near[targets[t]] = 1;
    }
  });
}

/// The same block by block of the lattice, each target against the sources of the blocks around its
/// own. Returns false, with nothing done, where blocks are too many to be told apart, or hold so
/// many sources that a tree is quicker.
bool decideByBlocks(std::span<const float> points, const Box& box, const Lattice& lattice,
                    const std::vector<uint32_t>& sources, const std::vector<uint32_t>& targets,
                    double distance, std::vector<uint8_t>& near) {
  const int level = lattice.blockLevel(box);
  if (level > kMaxLevel) return false;
  const auto sorted = [&](const std::vector<uint32_t>& list) {
    KeyedIndices keys(list.size());
    parallelFor(list.size(), kGrain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const Cell block = Lattice::blockOf(lattice.cellOf(&points[size_t{list[i]} * 3]));
        keys[i] = {mortonEncode(static_cast<uint32_t>(block[0]), static_cast<uint32_t>(block[1]),
                                static_cast<uint32_t>(block[2])),
                   list[i]};
      }
    });
    sortByKey(keys);
    return keys;
  };
  const KeyedIndices from = sorted(sources);
  std::vector<uint64_t> codes(from.size());
  for (size_t i = 0; i < from.size(); ++i) codes[i] = from[i].key;
  const CellTable blocks(codes, 0, level);
  if (from.size() > kMostPerBlock * blocks.size()) return false;
  std::vector<float> packed(from.size() * 3);
  for (size_t i = 0; i < from.size(); ++i) {
    std::copy_n(&points[size_t{from[i].index} * 3], 3, &packed[i * 3]);
  }
  const KeyedIndices to = sorted(targets);
  const double squared = distance * distance;
  const auto has = [&](uint32_t block, const float* at) {
    const double x = static_cast<double>(at[0]), y = static_cast<double>(at[1]),
                 z = static_cast<double>(at[2]);
    const float* last = &packed[0] + size_t{blocks.end(block)} * 3;
    for (const float* p = &packed[size_t{blocks.begin(block)} * 3]; p != last; p += 3) {
      const double dx = static_cast<double>(p[0]) - x, dy = static_cast<double>(p[1]) - y,
                   dz = static_cast<double>(p[2]) - z;
      if (dx * dx + dy * dy + dz * dz <= squared) return true;
    }
    return false;
  };
  parallelFor(to.size(), kGrain, [&](size_t begin, size_t end) {
    std::array<uint32_t, 27> around;
    uint32_t own = CellTable::kNone;
    size_t around_count = 0;
    bool is_looked_up = false;
    for (size_t t = begin; t < end; ++t) {
      if (t == begin || to[t].key != to[t - 1].key) {
        own = blocks.find(to[t].key);
        is_looked_up = false;
      }
      const float* at = &points[size_t{to[t].index} * 3];
      // Most are near one of their own block: then nobody asks for the others.
      bool found = own != CellTable::kNone && has(own, at);
      if (!found && !is_looked_up) {
        around_count = blocks.neighbours(to[t].key, around);
        is_looked_up = true;
      }
      for (size_t k = 0; k < around_count && !found; ++k) {
        found = around[k] != own && has(around[k], at);
      }
      if (found) near[to[t].index] = 1;
    }
  });
  return true;
}

/// Which points whose mask is not `source` are at most `distance` from one whose mask is. [N]
std::vector<uint8_t> nearOthers(std::span<const float> points, std::span<const uint8_t> mask,
                                uint8_t source, double distance) {
  std::vector<uint8_t> near(mask.size(), 0);
  const std::array<Box, 2> bounds = boundsOf(points, mask);
  // Widened by what rounding may take from a difference.
  std::array<Box, 2> reach = bounds;
  for (Box& box : reach) box.widen(distance * (1 + 1e-9));
  const auto chosen = [&](uint8_t kind) {
    const Box& other = reach[kind ^ 1];
    return listOf(mask.size(),
                  [&, kind](size_t i) { return mask[i] == kind && other.has(&points[i * 3]); });
  };
  const std::vector<uint32_t> sources = chosen(source);
  const std::vector<uint32_t> targets = chosen(source ^ 1);
  if (sources.empty() || targets.empty()) return near;
  Box box;
  for (const uint32_t i : sources) box.add(&points[size_t{i} * 3]);
  for (const uint32_t i : targets) box.add(&points[size_t{i} * 3]);
  const Lattice lattice(box, distance);
  if (!(distance > 0) || !lattice.isExact(box)) {
    decideByTree(points, box, sources, targets, distance, near);
    return near;
  }
  if (decideByBlocks(points, box, lattice, sources, targets, distance, near)) return near;
  CellSet cells, blocks;
  for (const uint32_t i : sources) {
    const Cell cell = lattice.cellOf(&points[size_t{i} * 3]);
    cells.insert(cell);
    blocks.insert(Lattice::blockOf(cell));
  }
  const CellSet around = widened(blocks);
  // 1: shares a cell with a source; 2: may have one in the blocks around.
  std::vector<uint8_t> state(targets.size(), 0);
  parallelFor(targets.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const Cell cell = lattice.cellOf(&points[size_t{targets[t]} * 3]);
      if (!around.has(Lattice::blockOf(cell))) continue;
      state[t] = cells.has(cell) ? 1 : 2;
      if (state[t] == 1) near[targets[t]] = 1;
    }
  });
  std::vector<uint32_t> open;
  CellSet open_blocks;
  for (size_t t = 0; t < targets.size(); ++t) {
    if (state[t] != 2) continue;
    open.push_back(targets[t]);
    open_blocks.insert(Lattice::blockOf(lattice.cellOf(&points[size_t{targets[t]} * 3])));
  }
  const CellSet asked = widened(open_blocks);
  const std::vector<uint32_t> rows = listOf(sources.size(), [&](size_t s) {
    return asked.has(Lattice::blockOf(lattice.cellOf(&points[size_t{sources[s]} * 3])));
  });
  std::vector<uint32_t> asked_sources(rows.size());
  for (size_t r = 0; r < rows.size(); ++r) asked_sources[r] = sources[rows[r]];
  decideByTree(points, box, asked_sources, open, distance, near);
  return near;
}

/// Squared distances of points to their k-th nearest other one. Cost: O(points x queries).
void squaredToNeighbours(std::span<const float> points, std::span<const uint32_t> queries,
                         std::span<double> squared) {
  constexpr size_t kBlock = 3 * 2048;  // stays in the cache while every query looks at it
  // The nearest ones so far, the furthest of them first; the point itself is among them.
  std::vector<std::vector<double>> nearest(queries.size());
  std::vector<double> limits(queries.size(), std::numeric_limits<double>::infinity());
  for (size_t begin = 0; begin < points.size(); begin += kBlock) {
    const size_t end = std::min(points.size(), begin + kBlock);
    for (size_t q = 0; q < queries.size(); ++q) {
      const float* at = &points[size_t{queries[q]} * 3];
      const double x = static_cast<double>(at[0]), y = static_cast<double>(at[1]),
                   z = static_cast<double>(at[2]);
      double limit = limits[q];
      for (size_t i = begin; i < end; i += 3) {
        const double dx = static_cast<double>(points[i]) - x;
        const double dy = static_cast<double>(points[i + 1]) - y;
        const double dz = static_cast<double>(points[i + 2]) - z;
        const double distance = dx * dx + dy * dy + dz * dz;
        if (distance >= limit) continue;  // nearly always
        std::vector<double>& heap = nearest[q];
        heap.push_back(distance);
        std::push_heap(heap.begin(), heap.end());
        if (heap.size() > kNeighbour + 1) {
          std::pop_heap(heap.begin(), heap.end());
          heap.pop_back();
        }
        if (heap.size() == kNeighbour + 1) limit = heap.front();
      }
      limits[q] = limit;
    }
  }
  for (size_t q = 0; q < queries.size(); ++q) squared[q] = nearest[q].front();
}

}  // namespace

std::vector<uint8_t> grown(std::span<const float> points, std::span<const uint8_t> mask,
                           double distance) {
  std::vector<uint8_t> result = nearOthers(points, mask, 1, distance);
  for (size_t i = 0; i < mask.size(); ++i) result[i] |= mask[i];
  return result;
}

std::vector<uint8_t> shrunken(std::span<const float> points, std::span<const uint8_t> mask,
                              double distance) {
  std::vector<uint8_t> result = nearOthers(points, mask, 0, distance);
  for (size_t i = 0; i < mask.size(); ++i) result[i] = mask[i] && !result[i] ? 1 : 0;
  return result;
}

double neighbourSpacing(std::span<const float> points, std::span<const uint8_t> mask) {
  const std::vector<uint32_t> selected =
      listOf(mask.size(), [&](size_t i) { return mask[i] != 0; });
  if (selected.empty()) return 0;
  const size_t count = std::min(selected.size(), kSpacingQueries);
  std::vector<uint32_t> queries(count);
  for (size_t q = 0; q < count; ++q) queries[q] = selected[q * selected.size() / count];
  std::vector<double> squared(count);
  parallelFor(count, 8, [&](size_t begin, size_t end) {
    squaredToNeighbours(points, std::span(queries).subspan(begin, end - begin),
                        std::span(squared).subspan(begin, end - begin));
  });
  const auto middle = squared.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(squared.begin(), middle, squared.end());
  return std::sqrt(*middle);
}

}  // namespace stipple
