#pragma once

#include <cstdint>
#include <memory>

#include "densify/control_part.h"
#include "densify/parts/opacity_reset.h"

namespace stipple {

/// Iterations are of a fit of 30,000.
struct RecoveryPruningOptions {
  double share = 0.2;    ///< of the splats, the faintest of which go
  uint64_t times = 2;    ///< after so many resets, from the first on
  uint64_t delay = 300;  ///< from a reset on
  /// Steps after a reset at least, however short the fit: opacities must have come back.
  uint64_t least_delay = 100;
  uint64_t reset_interval = OpacityResetOptions().interval;
  /// As of the resets: where they are left out, so is this.
  uint64_t least_reset_interval = OpacityResetOptions().least_steps;
};

/// A while after opacities were lowered, the splats that have not come back go: an exact number of
/// them, however many are equally faint. Owns kRecovery; needs kOpacity.
std::unique_ptr<ControlPart> makeRecoveryPruning(const RecoveryPruningOptions& options = {});

/// Whether splats go in one of the iterations [begin, end).
bool recoversWithin(uint64_t begin, uint64_t end, uint64_t iterations,
                    const RecoveryPruningOptions& options = {});

}  // namespace stipple
