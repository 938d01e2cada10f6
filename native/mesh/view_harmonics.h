#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "data/meshes/point_set.h"

namespace stipple {

/// Harmonics of what a place of a surface looks like from the sides that it is seen from: a
/// weighted least-squares fit to its colours from some directions, whose matrices are made once for
/// many normals. Directions from behind have little say, and higher degrees are held small, so
/// that what no direction tells is smooth.
class ViewHarmonics {
 public:
  /// In: directions [M,3], unit, from the eye to the surface; degree 1..kMaxViewDegree.
  /// Cost: 4,096 least-squares problems.
  ViewHarmonics(std::span<const float> directions, int degree);

  /// In: normal, unit; colour along it, and added [M,3]: what comes to it from each direction, all
  /// scene linear. Out: coefficients [(degree+1)^2,3] of the display value minus 0.5, as those of a
  /// splat are.
  void fit(const float* normal, const float* colour, std::span<const float> added,
           std::span<float> coefficients) const;

  size_t directionCount() const { return direction_count_; }
  size_t coefficientCount() const { return coefficient_count_; }

 private:
  size_t direction_count_;
  size_t coefficient_count_;
  /// [normal cells, coefficients, M + 1]: what gives coefficients from display values; the last
  /// column is of the colour along the normal.
  std::vector<float> solutions_;
};

}  // namespace stipple
