#pragma once

#include <cstddef>
#include <vector>

namespace stipple {

constexpr int kMaxViewDegree = 3;  ///< of harmonics of surface samples

/// Oriented, coloured samples of a surface. Points of a reconstruction have neither normals, areas
/// nor weights: those arrays are empty.
struct PointSet {
  std::vector<float> positions;  ///< [N,3] metres
  std::vector<float> normals;    ///< [N,3] unit
  std::vector<float> colours;    ///< [N,3] scene linear
  std::vector<float> opacities;  ///< [N] 0..1
  std::vector<float> areas;      ///< [N] m^2 of surface that the sample stands for
  std::vector<float> weights;    ///< [N] >= 0, share of the anchors that it attracts (sum is free)
  /// [N,(degree+1)^2 - 1,3] coefficients of display values from degree 1 on, or empty: how colours
  /// change with the side that they are seen from. `colours` are then their means over all sides.
  std::vector<float> harmonics;
  int harmonic_degree = 0;
  /// [N] seconds at which they were seen, NaN for one that is there at all times; empty: nothing is
  /// known of when.
  std::vector<double> times;

  size_t size() const { return opacities.size(); }
  /// Numbers of `harmonics` for each sample.
  size_t harmonicStride() const {
    return static_cast<size_t>(harmonic_degree) * static_cast<size_t>(harmonic_degree + 2) * 3;
  }
};

}  // namespace stipple
