#pragma once

#include <cstddef>
#include <vector>

namespace stipple {

/// Oriented, coloured samples of a surface. Points of a reconstruction have neither normals, areas
/// nor weights: those arrays are empty.
struct PointSet {
  std::vector<float> positions;  ///< [N,3] metres
  std::vector<float> normals;    ///< [N,3] unit
  std::vector<float> colours;    ///< [N,3] scene linear
  std::vector<float> opacities;  ///< [N] 0..1
  std::vector<float> areas;      ///< [N] m^2 of surface that the sample stands for
  std::vector<float> weights;    ///< [N] >= 0, share of the anchors that it attracts (sum is free)
  /// [N] seconds when the surface was there, NaN for one that is there at all times; empty: all
  /// are.
  std::vector<double> times;

  size_t size() const { return opacities.size(); }
};

}  // namespace stipple
