// Based on: Sandu, Pathak, Soundararajan, TAD-GS, arXiv 2606.23212, with the constants of its
// released program. Differs: what adaptive control differs in (adaptive.cpp); at most as many
// splats as max_splats says.

#include "densify/strategies/temporal.h"

#include "densify/parts/learning_rates.h"

namespace stipple {

TemporalOptions::TemporalOptions() {
  schedule.last = 17000;
  schedule.interval = 200;
  pull.least_opacity = kVisibleOpacity;
  removal.largest_share = 0;
  rates.first_position = 2.6e-4;
  rates.last_position = 2.6e-6;
  rates.log_scale = 1.5e-3;
}

ControlAssembly temporalControl(const TemporalOptions& options) {
  ControlAssembly assembly;
  assembly.schedule = options.schedule;
  addPart(assembly, makeScreenPull(options.pull));
  if (options.threshold) addPart(assembly, makeLifespanThreshold(*options.threshold));
  if (options.stretch) addPart(assembly, makeOffsetWarp(*options.stretch));
  addPart(assembly, makeCloneOrSplit(options.children));
  addPart(assembly, makeFaintRemoval(options.removal));
  addPart(assembly, makeOpacityReset(options.reset));
  addPart(assembly, makeLearningRates(options.rates));
  return assembly;
}

ControlAssembly temporalControl(StrategySettings& settings) {
  TemporalOptions options;
  options.pull.copy_threshold = options.pull.split_threshold =
      settings.number("threshold", options.pull.split_threshold, 1e-9, 1e9);
  if (!settings.flag("weighted", true)) options.pull.least_opacity.reset();
  if (!settings.flag("by_lifespan", true)) options.threshold.reset();
  if (!settings.flag("stretched", true)) options.stretch.reset();
  return temporalControl(options);
}

}  // namespace stipple
