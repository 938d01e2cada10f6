#pragma once

#include <cstdint>
#include <memory>

#include "densify/control_part.h"

namespace stipple {

struct OpacityResetOptions {
  uint64_t interval = 3000;  ///< iterations of 30,000 from one reset to the next
  double opacity = 0.01;     ///< what no opacity exceeds after one
  /// Resets of a short fit that come sooner after each other than this are left out: an opacity
  /// takes (logit 0.9 - logit 0.01) / 0.05 = 136 steps back, and a fit that is half way back learns
  /// from pictures of fog.
  uint64_t least_steps = 300;
  uint64_t soft_interval = 0;  ///< iterations of 30,000 between limits to soft_opacity; 0: none
  double soft_opacity = 0.8;
};

/// Opacities are lowered now and then, and their moments forgotten, so that splats which nothing
/// needs stay faint. Owns kOpacity.
std::unique_ptr<ControlPart> makeOpacityReset(const OpacityResetOptions& options = {});

/// Adds to an edit that no opacity exceeds this one; moments are forgotten.
void limitOpacities(const RawSplats& splats, double opacity, SplatEdit& edit);

}  // namespace stipple
