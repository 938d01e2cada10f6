#pragma once

#include "densify/control_part.h"
#include "densify/parts/clone_or_split.h"
#include "densify/parts/faint_removal.h"

namespace stipple {

class StrategySettings;

/// Defaults: as published, but for what the publication leaves open (strategy_revised.md).
struct RevisedOptions {
  EventSchedule schedule = {500, 27000, 100, 100};
  /// Errors of one view, 1 - SSIM summed over the pixels that show the splat, above which it
  /// multiplies. It grows with the pixels of the pictures.
  double threshold = 0.1;
  double small_share = 0.01;   ///< of the cameras' extent: larger splats are split
  double growth = 0.05;        ///< share of the count by which an event adds at most
  double decay = 0.001;        ///< opacity that every splat loses at an event
  double transmittance = 0.1;  ///< weight of the light that passes all splats, in the loss
  CloneOrSplitOptions children;
  FaintRemovalOptions removal = {0.005, 0, 3000, 0};
};

/// Density control by errors: "revised". Splats multiply that show what views get wrong, by their
/// greatest error of any view; a splat and its copy are as opaque as it was; opacities
/// fall slowly all the time instead of being reset.
ControlAssembly revisedControl(const RevisedOptions& options = {});
/// By its settings: threshold, growth, decay, transmittance.
ControlAssembly revisedControl(StrategySettings& settings);

/// Parts of it. Multiplication by errors, which are those of StatisticRequest::structure_errors;
/// a limit of growth per event, with as many iterations of 30,000 between events, compounded where
/// a short fit has fewer; opacities that decay.
std::unique_ptr<ControlPart> makeErrorPeaks(double threshold, double small_share);
std::unique_ptr<ControlPart> makeGrowthShare(double share, uint64_t interval);
std::unique_ptr<ControlPart> makeOpacityDecay(double decay);

}  // namespace stipple
