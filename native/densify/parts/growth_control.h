#pragma once

#include <cstdint>
#include <memory>

#include "densify/control_part.h"

namespace stipple {

struct GrowthControlOptions {
  /// Splats that there may be at the end; 0: as many as the fit allows, or, where it allows any
  /// number, `otherwise`. What the fit allows is never exceeded.
  uint64_t splats = 0;
  uint64_t otherwise = 1'000'000;
  uint64_t first = 500;   ///< iteration of 30,000 at which the curve begins at 0
  uint64_t last = 14500;  ///< and at which it ends
};

/// How many splats there may be grows as the square root of time: few while their places are still
/// wrong, so that those that come are worth having. Clouds that begin with more wait. Without
/// steps, events count instead of iterations. Owns kGrowth.
std::unique_ptr<ControlPart> makeGrowthControl(const GrowthControlOptions& options = {});

}  // namespace stipple
