#pragma once

#include <cstddef>
#include <cstdint>
#include <nanoflann.hpp>
#include <span>

namespace stipple {

/// Some of a list of points [N,3] as the rows of a k-d tree, through their indices. Both lists must outlive it.
struct PointRows {
  std::span<const float> points;
  std::span<const uint32_t> chosen;

  size_t kdtree_get_point_count() const { return chosen.size(); }
  double kdtree_get_pt(size_t row, size_t axis) const {
    return static_cast<double>(points[size_t{chosen[row]} * 3 + axis]);
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

/// Distances are squared, in double precision.
using PointTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointRows, double>,
                                        PointRows, 3, uint32_t>;

}  // namespace stipple
