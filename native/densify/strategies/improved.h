#pragma once

#include "densify/control_part.h"
#include "densify/parts/edge_aware_score.h"
#include "densify/parts/faint_removal.h"
#include "densify/parts/growth_control.h"
#include "densify/parts/long_axis_split.h"
#include "densify/parts/multi_step_update.h"
#include "densify/parts/opacity_reset.h"
#include "densify/parts/recovery_pruning.h"
#include "densify/parts/screen_pull.h"

namespace stipple {

class StrategySettings;

/// Defaults: as published, where the constructor sets them.
struct ImprovedOptions {
  ImprovedOptions();

  EventSchedule schedule;
  ScreenPullOptions pull;  ///< absolute gradients of 3e-4, from iteration 14,500 on of 2e-4
  EdgeAwareScoreOptions score;
  LongAxisSplitOptions split;
  FaintRemovalOptions removal;  ///< size is not judged; 0.02 once, after 300 iterations
  RecoveryPruningOptions recovery;
  OpacityResetOptions reset;  ///< to 0.05
  GrowthControlOptions growth;
  MultiStepUpdateOptions steps;
  LearningRates rates;  ///< positions a quarter, opacity half, higher harmonics twice the usual
};

/// Improved density control: "improved". Splats that pixels pull at from any side split along their
/// longest axis, those first that cover edges of the pictures; their number grows along a curve;
/// what does not come back after opacities were lowered goes; late steps are of several views.
ControlAssembly improvedControl(const ImprovedOptions& options = {});
/// With what the user sets: threshold, views, splats, recovery_share.
ControlAssembly improvedControl(StrategySettings& settings);

}  // namespace stipple
