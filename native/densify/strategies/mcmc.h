#pragma once

#include "densify/control_part.h"
#include "densify/parts/size_regulariser.h"

namespace stipple {

class StrategySettings;

/// Defaults: as published.
struct McmcOptions {
  EventSchedule schedule{500, 25000, 100, 100};
  double start_scale = 0.1;        ///< what the scales of a start are multiplied by, in 30,000
  double start_opacity = 0.5;      ///< of every splat of a start
  double dead_opacity = 0.005;     ///< splats that are at most this opaque move
  double growth = 0.05;            ///< more splats per published interval
  uint64_t most_splats = 1000000;  ///< beside the hard cap
  double noise = 5e5;              ///< times the rate of positions
  SizeRegulariserOptions regulariser;
};

/// Splats as samples of what the pictures ask for: "mcmc". Faint ones move to where opaque ones
/// are, some more come at every event, every splat that is faint trembles, and all pay for being
/// opaque and large; nothing is removed and opacities are never reset.
ControlAssembly mcmcControl(const McmcOptions& options = {});
/// With what the user sets: cap, growth, noise, opacity_weight, scale_weight.
ControlAssembly mcmcControl(StrategySettings& settings);

/// Its part that decides how many there may be: `growth` more per published interval of the
/// schedule, and at least one. Where events of a short fit are further apart than the schedule's,
/// each brings as much as those that it stands for. Owns kGrowth.
std::unique_ptr<ControlPart> makeSteadyGrowth(const EventSchedule& schedule, double growth,
                                              uint64_t most_splats);

/// Its part that lets splats tremble. Owns kNoise.
std::unique_ptr<ControlPart> makePositionNoise(double noise);

}  // namespace stipple
