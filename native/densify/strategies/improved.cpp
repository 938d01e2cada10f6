// Based on: Deng, Diao, Li, Yu, Xu, Improving Densification in 3D Gaussian Splatting for
// High-Fidelity Rendering, arXiv 2508.12313, with the constants of its published program. Differs:
// what its parts differ in; windows begin anew at every event, also where nothing splits.

#include "densify/strategies/improved.h"

#include "densify/parts/learning_rates.h"
#include "densify/strategies.h"

namespace stipple {

ImprovedOptions::ImprovedOptions() {
  pull.copy_statistic = pull.split_statistic = Statistic::kAbsoluteScreenGradients;
  pull.copy_threshold = pull.split_threshold = 3e-4;
  pull.late_after = 14500;
  pull.late_share = 1 / 1.5;
  removal.largest_share = 0;
  removal.until = 14900;
  removal.early_at = 300;
  removal.early_opacity = 0.02;
  reset.opacity = 0.05;
  rates.first_position = 4e-5;
  rates.last_position = 2e-6;
  rates.logit = 0.025;
  rates.higher_colour = 2.5e-4;
}

ControlAssembly improvedControl(const ImprovedOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeScreenPull(options.pull));
  addPart(assembly, makeEdgeAwareScore(options.score));
  addPart(assembly, makeLongAxisSplit(options.split));
  addPart(assembly, makeFaintRemoval(options.removal));
  addPart(assembly, makeRecoveryPruning(options.recovery));
  addPart(assembly, makeOpacityReset(options.reset));
  addPart(assembly, makeGrowthControl(options.growth));
  addPart(assembly, makeMultiStepUpdate(options.steps));
  addPart(assembly, makeLearningRates(options.rates));
  return assembly;
}

ControlAssembly improvedControl(StrategySettings& settings) {
  ImprovedOptions options;
  options.pull.copy_threshold = options.pull.split_threshold =
      settings.number("threshold", options.pull.split_threshold, 1e-9, 1e9);
  options.score.views = settings.count("views", options.score.views, 1000);
  options.growth.splats = settings.count("splats", options.growth.splats);
  options.recovery.share = settings.number("recovery_share", options.recovery.share, 0, 0.9);
  return improvedControl(options);
}

}  // namespace stipple
