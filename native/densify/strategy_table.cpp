#include "densify/parts/edge_aware_score.h"
#include "densify/parts/filter_3d.h"
#include "densify/parts/growth_control.h"
#include "densify/parts/lifespan_threshold.h"
#include "densify/parts/long_axis_split.h"
#include "densify/parts/multi_step_update.h"
#include "densify/parts/offset_warp.h"
#include "densify/parts/opacity_correction.h"
#include "densify/parts/recovery_pruning.h"
#include "densify/parts/screen_pull.h"
#include "densify/parts/splat_dropout.h"
#include "densify/strategies.h"
#include "densify/strategies/absolute.h"
#include "densify/strategies/adaptive.h"
#include "densify/strategies/direction.h"
#include "densify/strategies/frequency.h"
#include "densify/strategies/improved.h"
#include "densify/strategies/mcmc.h"
#include "densify/strategies/metropolis.h"
#include "densify/strategies/revised.h"
#include "densify/strategies/taming.h"
#include "densify/strategies/temporal.h"
#include "densify/strategies/volumetric.h"

namespace stipple {

namespace {

ControlAssembly makeAdaptive(StrategySettings& settings) {
  AdaptiveOptions options;
  const double threshold = settings.number("threshold", options.pull.copy_threshold, 1e-9, 1e9);
  options.pull.copy_threshold = options.pull.split_threshold = threshold;
  return adaptiveControl(options);
}

ControlAssembly makeAbsolute(StrategySettings& settings) {
  AbsoluteOptions options;
  ScreenPullOptions& pull = options.pull;
  pull.split_threshold = settings.number("threshold", pull.split_threshold, 1e-9, 1e9);
  pull.copy_threshold = settings.number("copy_threshold", pull.copy_threshold, 1e-9, 1e9);
  return absoluteControl(options);
}

ControlAssembly edgeAwareScore(StrategySettings& settings) {
  EdgeAwareScoreOptions options;
  options.views = settings.count("views", options.views, 1000);
  return assemblyOf(makeEdgeAwareScore(options));
}

ControlAssembly longAxisSplit(StrategySettings& settings) {
  LongAxisSplitOptions options;
  options.offset = settings.number("offset", options.offset, 0, 10);
  options.long_scale = settings.number("long", options.long_scale, 0.01, 1);
  options.minor_scale = settings.number("minor", options.minor_scale, 0.01, 1);
  options.opacity = settings.number("opacity", options.opacity, 0.01, 1);
  return assemblyOf(makeLongAxisSplit(options));
}

ControlAssembly recoveryPruning(StrategySettings& settings) {
  RecoveryPruningOptions options;
  options.share = settings.number("share", options.share, 0, 0.9);
  return assemblyOf(makeRecoveryPruning(options));
}

ControlAssembly growthControl(StrategySettings& settings) {
  GrowthControlOptions options;
  options.splats = settings.count("splats", options.splats);
  return assemblyOf(makeGrowthControl(options));
}

ControlAssembly multiStepUpdate(StrategySettings& settings) {
  MultiStepUpdateOptions options;
  options.few = settings.count("few", options.few, 1000);
  options.many = settings.count("many", options.many, 1000);
  return assemblyOf(makeMultiStepUpdate(options));
}

ControlAssembly opacityCorrection(StrategySettings&) {
  return assemblyOf(makeOpacityCorrection());
}

ControlAssembly volumeSplitPart(StrategySettings& settings) {
  return assemblyOf(volumeSplit(settings));
}

ControlAssembly visibilityWeightedScore(StrategySettings& settings) {
  ScreenPullOptions options;
  options.copy_threshold = options.split_threshold =
      settings.number("threshold", options.split_threshold, 1e-9, 1e9);
  options.least_opacity = settings.number("opacity", kVisibleOpacity, 0, 1);
  return assemblyOf(makeScreenPull(options));
}

ControlAssembly lifespanThreshold(StrategySettings& settings) {
  LifespanThresholdOptions options;
  options.least = settings.number("least", options.least, 0.01, 1);
  options.power = settings.number("power", options.power, 0.01, 100);
  return assemblyOf(makeLifespanThreshold(options));
}

ControlAssembly offsetWarp(StrategySettings& settings) {
  TimeStretch stretch = kPublishedStretch;
  stretch.frames = settings.number("frames", stretch.frames, 1, 1e6);
  stretch.share = settings.number("share", stretch.share, 0.01, 0.99);
  return assemblyOf(makeOffsetWarp(stretch));
}

ControlAssembly splatDropoutPart(StrategySettings& settings) {
  return assemblyOf(splatDropout(settings));
}

ControlAssembly filter3dPart(StrategySettings& settings) {
  return assemblyOf(filter3d(settings));
}

}  // namespace

const std::vector<StrategyEntry>& strategyEntries() {
  static const std::vector<StrategyEntry> kEntries = {
      {.name = "adaptive",
       .label = "Adaptive",
       .summary = "Copies small splats and splits large ones at which the images pull",
       .make = makeAdaptive},
      {.name = "absolute",
       .label = "Absolute",
       .summary = "As adaptive, and finds the blurred splats that lie over fine texture",
       .make = makeAbsolute},
      {.name = "improved",
       .label = "Improved",
       .summary =
           "Splits along the longest side where images have edges: sharper with fewer splats",
       .make = improvedControl},
      {.name = "direction",
       .label = "Direction",
       .summary = "As adaptive, and looks whether the pixels of a splat agree: fewer splats",
       .make = directionControl},
      {.name = "volumetric",
       .label = "Volumetric",
       .summary = "As adaptive, and splits what fills a large volume",
       .make = volumetricControl},
      {.name = "frequency",
       .label = "Frequency",
       .summary =
           "Lets sizes follow how close splats stand, and asks pairs of views what to remove",
       .make = frequencyControl},
      {.name = "mcmc",
       .label = "MCMC",
       .summary = "Moves faint splats to where opaque ones are, up to a number that you set",
       .make = mcmcControl},
      {.name = "metropolis",
       .label = "Metropolis",
       .summary = "Tries new splats where images are wrong and keeps them where there is room",
       .make = metropolisControl},
      {.name = "taming",
       .label = "Taming",
       .summary = "Spends a budget of splats on those that matter most to the images",
       .make = tamingControl},
      {.name = "revised",
       .label = "Revised",
       .summary = "Multiplies the splats with the largest errors of the images, at a steady pace",
       .make = revisedControl},
      {.name = "temporal",
       .label = "Temporal",
       .summary = "As adaptive, for splats that move: what lives for a short time multiplies, too",
       .make = temporalControl},
      // Further strategies go here.
  };
  return kEntries;
}

const std::vector<StrategyEntry>& partEntries() {
  static const std::vector<StrategyEntry> kEntries = {
      {.name = "edge_aware_score",
       .label = "Edge Aware Score",
       .summary = "Adds detail first where the images have edges",
       .make = edgeAwareScore,
       .bit = 0},
      {.name = "long_axis_split",
       .label = "Long Axis Split",
       .summary = "Splits along the longest side, so that two halves fill the same outline",
       .make = longAxisSplit,
       .bit = 1},
      {.name = "volume_split",
       .label = "Volume Split",
       .summary = "Also splits whatever fills a large volume, long shapes into smaller pieces",
       .make = volumeSplitPart,
       .bit = 2},
      {.name = "recovery_pruning",
       .label = "Recovery Pruning",
       .summary = "Removes the splats that stay faint after their opacity was lowered",
       .make = recoveryPruning,
       .bit = 3},
      {.name = "growth_control",
       .label = "Growth Control",
       .summary = "Adds splats slowly at first, along a curve that ends at the limit",
       .make = growthControl,
       .bit = 4},
      {.name = "multi_step_update",
       .label = "Multi Step Update",
       .summary = "Learns from several views at a time towards the end: smoother, faster",
       .make = multiStepUpdate,
       .bit = 5},
      {.name = "opacity_correction",
       .label = "Opacity Correction",
       .summary = "Keeps copies together as opaque as the splat that they came from",
       .make = opacityCorrection,
       .bit = 6},
      {.name = "filter_3d",
       .label = "Filter 3D",
       .summary = "Makes no splat finer than the images can show, so that zooming in stays smooth",
       .make = filter3dPart,
       .bit = 7},
      {.name = "visibility_weighted_score",
       .label = "Visibility Weighted Score",
       .summary = "Counts an image by how opaque a splat is in it, so that fading hides no pull",
       .make = visibilityWeightedScore,
       .bit = 8},
      {.name = "lifespan_threshold",
       .label = "Lifespan Threshold",
       .summary = "Lets splats that live for a short time multiply at a weaker pull",
       .make = lifespanThreshold,
       .bit = 9},
      {.name = "offset_warp",
       .label = "Offset Warp",
       .summary = "Stretches time about each splat's moment, where it is seen and moves most",
       .make = offsetWarp,
       .bit = 10},
      {.name = "splat_dropout",
       .label = "Splat Dropout",
       .summary = "Leaves some splats out of each image: with few views, others come out better",
       .make = splatDropoutPart,
       .bit = 11},
      // Further parts go here, each with the next bit.
  };
  return kEntries;
}

const std::vector<StrategyEntry>& fieldStrategyEntries() {
  static const std::vector<StrategyEntry> kEntries = {
      {.name = "learned_density",
       .label = "Learned Density",
       .summary = "Moves a density towards the places where splats bring images nearest"},
  };
  return kEntries;
}

}  // namespace stipple
