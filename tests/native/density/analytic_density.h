#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "density/density_model.h"
#include "math/morton.h"

namespace stipple {

/// A density that nobody stores: 8 x y z over the unit cube of its root, which is 2 x along each
/// axis. The mass between a and b of an axis is b^2 - a^2.
class AnalyticDensity final : public DensityModel {
 public:
  explicit AnalyticDensity(int leaf_level, const RootCube& root = {})
      : leaf_level_(leaf_level), root_(root) {}

  int leafLevel() const override { return leaf_level_; }
  const RootCube& root() const override { return root_; }
  void childLogProbabilities(int, std::span<const uint64_t> cells, std::span<float> out,
                             Progress* = nullptr) const override {
    ++questions;
    cells_asked += cells.size();
    for (size_t n = 0; n < cells.size(); ++n) {
      const auto at = mortonDecode(cells[n]);
      for (size_t child = 0; child < 8; ++child) {
        double log_share = 0;
        for (size_t axis = 0; axis < 3; ++axis) {
          // Of the halves of the cell i: (2i + 1)^2 - (2i)^2 and (2i + 2)^2 - (2i + 1)^2.
          const double i = at[axis];
          const double lower = 4 * i + 1, upper = 4 * i + 3;
          log_share += std::log(((child >> axis & 1) != 0 ? upper : lower) / (lower + upper));
        }
        out[n * 8 + child] = static_cast<float>(log_share);
      }
    }
  }

  /// Probability of a cell of any level, in closed form.
  static double mass(uint64_t cell, int level) {
    double mass = 1;
    for (const uint32_t i : mortonDecode(cell)) mass *= (2.0 * i + 1) * std::ldexp(1.0, -2 * level);
    return mass;
  }

  mutable size_t questions = 0;
  mutable size_t cells_asked = 0;

 private:
  int leaf_level_;
  RootCube root_;
};

}  // namespace stipple
