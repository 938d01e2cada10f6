#pragma once

#include <span>

#include "densify/control_part.h"
#include "densify/parts/opacity_reset.h"
#include "densify/quantities/local_radius.h"

namespace stipple {

class StrategySettings;

/// Defaults: as published.
struct FrequencyOptions {
  /// Radii that are set anew are learned back at 5e-3 per step, and a look at all views costs as
  /// many steps as there are views: events of short fits keep 250 steps between them.
  EventSchedule schedule{500, 15000, 500, 250};
  double start_scale = 0.75;      ///< what the scales of a start are multiplied by
  double least_threshold = 5e-4;  ///< of gradients, per half picture
  double quantile = 0.75;         ///< of gradients, from which on splats multiply
  double least_confidence = 0.2;  ///< splats that two views agree on less go
  double random_removal = 0.05;   ///< share that goes where the threshold is at its least
  LocalRadiusOptions radius;
  OpacityResetOptions reset;
};

/// Scales follow how close splats stand: "frequency". Every event looks at all views with their
/// gradients, lets the splats multiply whose gradient is high among all, removes at every second
/// event those whose two best views show different things under them, and sets the radius of every
/// splat to what its neighbours say.
ControlAssembly frequencyControl(const FrequencyOptions& options = {});
/// With what the user sets: threshold, quantile, confidence, random_removal.
ControlAssembly frequencyControl(StrategySettings& settings);

struct DynamicThreshold {
  double value = 0;
  bool is_least = false;  ///< the quantile is below the least threshold: all is learned
};

/// The quantile of the gradients up to three times their mean, to a 1000th of that range. Where
/// there are none, or all are 0: the least, and nothing is learned.
DynamicThreshold dynamicThreshold(std::span<const double> gradients,
                                  const FrequencyOptions& options = {});

}  // namespace stipple
