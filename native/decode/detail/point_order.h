#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// Curves that go through all cells of a grid, by which points are put in a row.
enum class CellCurve {
  kMorton,        ///< x has the highest bit
  kMortonTurned,  ///< the same with x and y exchanged
  kHilbert,
  kHilbertTurned,
};
constexpr size_t kCellCurves = 4;
/// Bits of a cell's number along an axis, at most: codes have three times as many.
constexpr int kMostCellBits = 16;

/// Where a cell is along a curve. In: bits: as many as the largest number of a cell has. Source of
/// Hilbert's: J. Skilling, Programming the Hilbert Curve, AIP Conference Proceedings 707, 2004.
uint64_t curveCode(CellCurve curve, const std::array<uint32_t, 3>& cell, int bits);

/// Cells of points in a grid that begins at the least of each coordinate.
struct PointCells {
  std::vector<std::array<uint32_t, 3>> cells;
  int bits = 1;  ///< that the largest number of a cell has

  /// Points along a curve; those of one cell in their own order.
  std::vector<uint32_t> orderAlong(CellCurve curve) const;
};
/// In: points [n,3], finite; side of a cell > 0. Errors: kInvalidArgument where cells are so small
/// that there are more than 2^16 along an axis.
PointCells cellsOf(std::span<const float> points, double side);

}  // namespace stipple
