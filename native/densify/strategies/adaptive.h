#pragma once

#include "densify/control_part.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/faint_removal.h"
#include "densify/parts/opacity_reset.h"
#include "densify/parts/screen_pull.h"

namespace stipple {

/// Defaults: as published.
struct AdaptiveOptions {
  EventSchedule schedule;
  ScreenPullOptions pull;
  CloneOrSplitOptions children;
  FaintRemovalOptions removal;
  OpacityResetOptions reset;
};

/// Adaptive density control: "adaptive". Splats that the views pull at are copied where they are
/// small and split where they are large, faint and huge ones go, and opacities are lowered now and
/// then so that those which nothing needs stay faint. Where an edit would exceed max_splats, the
/// splats that are pulled at most are the ones that multiply.
ControlAssembly adaptiveControl(const AdaptiveOptions& options = {});

}  // namespace stipple
