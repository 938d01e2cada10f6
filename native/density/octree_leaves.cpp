#include "density/octree_leaves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "base/default_init_vector.h"
#include "base/error.h"
#include "base/parallel.h"
#include "math/morton.h"

namespace stipple {
namespace {

constexpr size_t kGrain = size_t{1} << 16;
constexpr int kDigitBits = 10;
constexpr size_t kDigits = size_t{1} << kDigitBits;
constexpr double kGrowth = 1.01;            // sides of the root over those of the bounding cube
constexpr double kSinglePointSide = 0.001;  // metres

/// One point: Morton code of its leaf above its index, so that a sort by code can be stable.
using Key = uint64_t;
uint64_t codeOf(Key key) {
  return key >> 32;
}
size_t indexOf(Key key) {
  return static_cast<uint32_t>(key);
}

/// Stable counting sort by one digit of the code.
void sortByDigit(const DefaultInitVector<Key>& from, DefaultInitVector<Key>& to, int shift) {
  const size_t ranges = rangeCount(from.size(), kGrain);
  std::vector<std::array<uint32_t, kDigits>> starts(ranges);
  const auto digit = [shift](Key key) { return (codeOf(key) >> shift) & (kDigits - 1); };
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    std::array<uint32_t, kDigits>& histogram = starts[begin / kGrain];
    histogram.fill(0);
    for (size_t i = begin; i < end; ++i) ++histogram[digit(from[i])];
  });
  uint32_t start = 0;
  for (size_t value = 0; value < kDigits; ++value) {
    for (auto& histogram : starts) start += std::exchange(histogram[value], start);
  }
  parallelFor(from.size(), kGrain, [&](size_t begin, size_t end) {
    std::array<uint32_t, kDigits>& next = starts[begin / kGrain];
    for (size_t i = begin; i < end; ++i) to[next[digit(from[i])]++] = from[i];
  });
}

uint32_t cellCoordinate(float position, double origin, double cells_per_metre, uint32_t last) {
  const double cell = (static_cast<double>(position) - origin) * cells_per_metre;
  // Rounding can leave a point of the boundary a little outside.
  return cell > 0.0 ? std::min(last, static_cast<uint32_t>(cell)) : 0;
}

}  // namespace

RootCube boundingCube(std::span<const float> positions, std::span<const float> weights) {
  const size_t count = positions.size() / 3;
  if (count == 0) {
    fail(ErrorCode::kInvalidArgument, "the density got 0 points; it needs at least 1");
  }
  if (count > std::numeric_limits<uint32_t>::max()) {
    fail(ErrorCode::kInvalidArgument,
         "the density got " + std::to_string(count) + " points; allowed are at most 4294967295");
  }
  if (positions.size() != 3 * count || (!weights.empty() && weights.size() != count)) {
    fail(ErrorCode::kInvalidArgument,
         "the density got " + std::to_string(positions.size()) + " coordinates and " +
             std::to_string(weights.size()) +
             " weights; allowed are 3 coordinates and 1 weight a point");
  }
  requireFinite(positions.data(), positions.size(), 3, "position");
  requireFinite(weights.data(), weights.size(), 1, "weight");
  struct Part {
    std::array<float, 3> low, high;
    size_t negative = std::numeric_limits<size_t>::max();  // first point with a weight below 0
    bool mass = false;
  };
  std::vector<Part> parts(rangeCount(count, kGrain));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    Part part;
    part.low =
        part.high = {positions[3 * begin], positions[3 * begin + 1], positions[3 * begin + 2]};
    for (size_t i = begin; i < end; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) {
        part.low[axis] = std::min(part.low[axis], positions[3 * i + axis]);
        part.high[axis] = std::max(part.high[axis], positions[3 * i + axis]);
      }
    }
    for (size_t i = begin; i < (weights.empty() ? begin : end); ++i) {
      part.mass = part.mass || weights[i] > 0.0f;
      if (weights[i] < 0.0f) part.negative = std::min(part.negative, i);
    }
    parts[begin / kGrain] = part;
  });
  Part whole = parts.front();
  whole.mass = weights.empty();
  for (const Part& part : parts) {
    for (size_t axis = 0; axis < 3; ++axis) {
      whole.low[axis] = std::min(whole.low[axis], part.low[axis]);
      whole.high[axis] = std::max(whole.high[axis], part.high[axis]);
    }
    whole.mass = whole.mass || part.mass;
    whole.negative = std::min(whole.negative, part.negative);
  }
  if (whole.negative < count) {
    fail(ErrorCode::kInvalidArgument, "weight " + std::to_string(whole.negative) + " is " +
                                          std::to_string(weights[whole.negative]) +
                                          "; allowed are finite values from 0 up");
  }
  if (!whole.mass) {
    fail(ErrorCode::kInvalidArgument,
         "all " + std::to_string(count) + " weights are 0; at least one must be positive");
  }
  RootCube root;
  double extent = 0.0;
  for (size_t axis = 0; axis < 3; ++axis) {
    extent = std::max(extent,
                      static_cast<double>(whole.high[axis]) - static_cast<double>(whole.low[axis]));
  }
  root.side = extent > 0.0 ? kGrowth * extent : kSinglePointSide;
  for (size_t axis = 0; axis < 3; ++axis) {
    root.origin[axis] = 0.5 * (static_cast<double>(whole.low[axis]) +
                               static_cast<double>(whole.high[axis]) - root.side);
  }
  return root;
}

OctreeLeaves gatherLeaves(std::span<const float> positions, std::span<const float> weights,
                          const RootCube& root, int leaf_level) {
  const size_t count = positions.size() / 3;
  const double side_cells = static_cast<double>(1u << leaf_level);
  const double cells_per_metre = side_cells / root.side;
  const uint32_t last = (1u << leaf_level) - 1;
  DefaultInitVector<Key> keys(count);
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::array<uint32_t, 3> cell;
      for (size_t axis = 0; axis < 3; ++axis) {
        cell[axis] =
            cellCoordinate(positions[3 * i + axis], root.origin[axis], cells_per_metre, last);
      }
      keys[i] = mortonEncode(cell[0], cell[1], cell[2]) << 32 | i;
    }
  });
  DefaultInitVector<Key> other(count);
  for (int shift = 0; shift < 3 * leaf_level; shift += kDigitBits) {
    sortByDigit(keys, other, shift);
    std::swap(keys, other);
  }
  other = {};
  // Each range sums the leaves that start in it; the last of them may reach into the next range.
  std::vector<OctreeLeaves> parts(rangeCount(count, kGrain));
  parallelFor(count, kGrain, [&](size_t begin, size_t end) {
    OctreeLeaves& part = parts[begin / kGrain];
    size_t i = begin;
    while (i > 0 && i < end && codeOf(keys[i]) == codeOf(keys[i - 1])) ++i;
    while (i < end) {
      const uint64_t code = codeOf(keys[i]);
      double mass = 0.0;
      for (; i < count && codeOf(keys[i]) == code; ++i) {
        mass += weights.empty() ? 1.0 : static_cast<double>(weights[indexOf(keys[i])]);
      }
      if (mass <= 0.0) continue;
      part.codes.push_back(code);
      part.masses.push_back(mass);
    }
  });
  OctreeLeaves leaves = std::move(parts.front());
  for (size_t i = 1; i < parts.size(); ++i) {
    leaves.codes.insert(leaves.codes.end(), parts[i].codes.begin(), parts[i].codes.end());
    leaves.masses.insert(leaves.masses.end(), parts[i].masses.begin(), parts[i].masses.end());
  }
  return leaves;
}

}  // namespace stipple
