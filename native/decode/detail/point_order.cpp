#include "decode/detail/point_order.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "base/error.h"
#include "math/morton.h"

namespace stipple {

namespace {

/// Morton code of the result is how far along Hilbert's curve a cell is.
std::array<uint32_t, 3> hilbertAxes(std::array<uint32_t, 3> x, int bits) {
  for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1) {
    const uint32_t below = bit - 1;
    for (uint32_t& axis : x) {
      if (axis & bit) {
        x[0] ^= below;
      } else {
        const uint32_t exchanged = (x[0] ^ axis) & below;
        x[0] ^= exchanged;
        axis ^= exchanged;
      }
    }
  }
  x[1] ^= x[0];
  x[2] ^= x[1];
  uint32_t turned = 0;
  for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1) {
    if (x[2] & bit) turned ^= bit - 1;
  }
  for (uint32_t& axis : x) axis ^= turned;
  return x;
}

}  // namespace

uint64_t curveCode(CellCurve curve, const std::array<uint32_t, 3>& cell, int bits) {
  std::array<uint32_t, 3> at = cell;
  if (curve == CellCurve::kMortonTurned || curve == CellCurve::kHilbertTurned) {
    std::swap(at[0], at[1]);
  }
  if (curve == CellCurve::kHilbert || curve == CellCurve::kHilbertTurned)
    at = hilbertAxes(at, bits);
  return mortonEncode(at[2], at[1], at[0]);
}

std::vector<uint32_t> PointCells::orderAlong(CellCurve curve) const {
  std::vector<uint64_t> codes;
  codes.reserve(cells.size());
  for (const std::array<uint32_t, 3>& cell : cells) codes.push_back(curveCode(curve, cell, bits));
  std::vector<uint32_t> order(cells.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return codes[a] < codes[b]; });
  return order;
}

PointCells cellsOf(std::span<const float> points, double side) {
  PointCells made;
  std::array<float, 3> least;
  least.fill(std::numeric_limits<float>::max());
  for (size_t i = 0; i < points.size(); ++i) least[i % 3] = std::min(least[i % 3], points[i]);
  made.cells.resize(points.size() / 3);
  uint32_t largest = 1;
  for (size_t i = 0; i < points.size(); ++i) {
    const double place =
        (static_cast<double>(points[i]) - static_cast<double>(least[i % 3])) / side;
    if (!(place < std::ldexp(1.0, kMostCellBits))) {
      fail(ErrorCode::kInvalidArgument, "points reach over " + std::to_string(place) +
                                            " cells of " + std::to_string(side) + "; less than " +
                                            std::to_string(1 << kMostCellBits) + " are allowed");
    }
    made.cells[i / 3][i % 3] = static_cast<uint32_t>(place);
    largest = std::max(largest, made.cells[i / 3][i % 3]);
  }
  made.bits = static_cast<int>(std::bit_width(largest));
  return made;
}

}  // namespace stipple
