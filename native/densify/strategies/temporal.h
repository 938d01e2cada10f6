#pragma once

#include <optional>

#include "densify/control_part.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/faint_removal.h"
#include "densify/parts/lifespan_threshold.h"
#include "densify/parts/offset_warp.h"
#include "densify/parts/opacity_reset.h"
#include "densify/parts/screen_pull.h"
#include "densify/strategies.h"

namespace stipple {

/// Defaults: as the released program has them.
struct TemporalOptions {
  TemporalOptions();

  EventSchedule schedule;
  ScreenPullOptions pull;
  /// Absent: one threshold for all.
  std::optional<LifespanThresholdOptions> threshold = LifespanThresholdOptions();
  std::optional<TimeStretch> stretch = kPublishedStretch;  ///< absent: time is as it is
  CloneOrSplitOptions children;
  FaintRemovalOptions removal;
  OpacityResetOptions reset;
  LearningRates rates;
};

/// Adaptive density control for splats that move: "temporal". A view counts by how opaque it shows
/// a splat, splats that live for a short time multiply at a weaker pull, and time is stretched
/// about each splat's moment.
ControlAssembly temporalControl(const TemporalOptions& options);
ControlAssembly temporalControl(StrategySettings& settings);

}  // namespace stipple
