#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple {

/// The inside of a closed outline by the even-odd rule. Rows of the plane list the edges that cross
/// them, so that a point is compared with a few edges, whatever their number.
class LassoOutline {
 public:
  /// In: points [n,2], n >= 3, finite; the last one leads back to the first.
  explicit LassoOutline(std::span<const float> points);
  /// As if every edge were looked at, in double: a point is above an edge's end where its y is
  /// smaller, and right of an edge where its x is not smaller than the edge's at the same y.
  bool covers(double x, double y) const;

 private:
  struct Edge {
    double x, y, end_y;
    double slope;  ///< change of x with y
  };

  size_t rowAt(double y) const;

  double x0_, y0_, x1_, y1_;
  double rows_per_px_ = 0;
  std::vector<uint32_t> begins_;  ///< of each row in edges_
  std::vector<Edge> edges_;       ///< an edge stands in each row that it crosses
};

}  // namespace stipple
