#pragma once

#include <cstdint>

#include "densify/control_part.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/faint_removal.h"
#include "densify/parts/opacity_reset.h"
#include "densify/parts/screen_pull.h"

namespace stipple {

class StrategySettings;

/// Weights of what makes a splat important, each over its median among the splats of a view.
struct TamingWeights {
  double pull = 25;  ///< as density control measures it
  double opacity = 100;
  double depth = 5;
  double radius = 10;     ///< in the picture
  double volume = 25;     ///< product of scales
  double distances = 50;  ///< of the pixels that show it from its centre, summed
  double errors = 10;     ///< of those pixels, summed
  double pixels = 0.1;    ///< their number
  double blending = 50;   ///< its blending weights, summed
};

/// Defaults: as published.
struct TamingOptions {
  EventSchedule schedule;
  ScreenPullOptions pull;
  CloneOrSplitOptions children;
  TamingWeights weights;
  uint64_t view_count = 10;  ///< that are looked at before each event
  double error_weight = 50;  ///< of the absolute difference of a pixel, over the greatest
  double edge_weight = 50;   ///< of the edge in a pixel
  double budget = 2;         ///< splats at the end over those of the start, where no cap is set
  FaintRemovalOptions removal;
  double removed_share = 0.5;     ///< of those that `removal` names, in each event
  uint64_t removal_until = 3200;  ///< iteration of 30,000 of the last event at which splats go
  OpacityResetOptions reset;
  double opacity_rate = 0.025;
};

/// Density control to a budget: "taming". As many splats multiply per event as a curve allows,
/// drawn by how much they matter to the pictures.
ControlAssembly tamingControl(const TamingOptions& options = {});
/// By its settings: threshold, budget, views.
ControlAssembly tamingControl(StrategySettings& settings);

/// The curve: count at `done` (0..1) of the events, from `start` to `end`. Ends slowly:
/// end - (end - start) (1 - done)^2.
uint64_t tamingCount(uint64_t start, uint64_t end, double done);

}  // namespace stipple
