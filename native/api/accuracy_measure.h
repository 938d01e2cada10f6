#pragma once

#include <stipple/stipple.h>

#include <string>
#include <vector>

#include "api/cloud_cuts.h"
#include "api/handles.h"
#include "api/render_settings.h"
#include "data/accuracy_report.h"

namespace stipple::api {

/// Of all instances.
uint64_t splatsOf(const Instances& instances);

/// "preview", or the level with the knobs that differ from it: "final + projection ray".
std::string accuracyName(const StippleAccuracy& accuracy);

struct MeasureSettings {
  std::vector<StippleAccuracy> accuracies;
  uint32_t repetitions = 0;
  uint64_t reference_pixels = 0;
  double most_seconds = 0;
};

/// In: options, or NULL. Errors: kInvalidArgument.
MeasureSettings measureSettings(const StippleAccuracyMeasureOptions* options, const Camera& camera);

/// Bytes that measureAccuracy allocates at most.
RenderMemory measureMemory(const Instances& instances, const Camera& camera,
                           const RenderSettings& render, const MeasureSettings& settings);

/// Draws the view at every accuracy and against the reference.
AccuracyResult measureAccuracy(const Instances& instances, const Camera& camera,
                               const RenderSettings& render, const MeasureSettings& settings,
                               Progress& progress);

}  // namespace stipple::api
