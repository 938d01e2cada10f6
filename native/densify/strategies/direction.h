#pragma once

#include <memory>

#include "densify/control_part.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/faint_removal.h"
#include "densify/parts/opacity_reset.h"

namespace stipple {

class StrategySettings;

/// Weight of a splat whose pixels agree to the share C about where it should go: base + gain
/// (1 - C)^power.
struct DirectionPullOptions {
  double base = 0.8;
  double gain = 25;
  double power = 15;
  double threshold = 2e-4;     ///< of the gradient times the weight (splits) or over it (copies)
  double small_share = 0.002;  ///< of the cameras' extent: the largest scale of a small splat
};

/// Defaults: as published.
struct DirectionOptions {
  EventSchedule schedule;
  DirectionPullOptions pull;
  CloneOrSplitOptions children;
  FaintRemovalOptions removal = {.least_opacity = 0.008};
  OpacityResetOptions reset = {.soft_interval = 500};
};

/// Density control by the direction of gradients: "direction". As adaptive, but large splats whose
/// pixels disagree about where they should go split sooner, and small ones whose pixels disagree
/// are not copied: a copy would be torn the same way.
ControlAssembly directionControl(const DirectionOptions& options = {});
/// With what the user sets: threshold, base, gain, power.
ControlAssembly directionControl(StrategySettings& settings);

/// Its part that owns kMultiplication.
std::unique_ptr<ControlPart> makeDirectionPull(const DirectionPullOptions& options = {});

/// base + gain (1 - C)^power. In: coherence C: held to 0..1.
double directionWeight(const DirectionPullOptions& options, double coherence);

}  // namespace stipple
