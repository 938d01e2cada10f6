#pragma once

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
  LifespanThresholdOptions threshold;
  TimeStretch stretch = kPublishedStretch;
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
