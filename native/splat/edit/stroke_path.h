#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// All points of a plane at most `radius` from a path: the union of capsules around its segments.
/// Cells of a grid say where a point is surely inside or outside; only in the others its distance
/// to the segments nearby is taken, so that a path of thousands of points costs about what one
/// does.
class StrokePath {
 public:
  /// In: points [n,2], n >= 1, finite; radius >= 0. Cost: bounded, whatever the path.
  StrokePath(std::span<const float> points, double radius);
  /// As if the distance to every segment were compared with the radius, in double.
  bool covers(double x, double y) const;

 private:
  struct Segment {
    double x, y, dx, dy;
    double inverse;  ///< of the squared length; 0 for a point
  };
  enum class CellState : uint8_t { kOutside, kNear, kInside };

  double squaredDistance(const Segment& segment, double x, double y) const;
  double visitsOf(size_t side) const;
  template <class Visit>
  void forCellsNear(const Segment& segment, double reach, const Visit& visit) const;
  void layCells();
  size_t cellAt(double x, double y) const;

  std::vector<Segment> segments_;
  double radius_;
  double x0_, y0_, x1_, y1_;
  size_t side_ = 1;  ///< cells along each axis
  double cell_width_ = 0, cell_height_ = 0;
  double columns_per_px_ = 0, rows_per_px_ = 0;
  std::vector<CellState> states_;
  std::vector<uint32_t> begins_;  ///< of each cell in listed_
  std::vector<uint32_t> listed_;  ///< segments
};

}  // namespace stipple
