#pragma once

#include <stipple/stipple.h>

#include "api/instances.h"
#include "splat/render/accurate_render.h"
#include "splat/render/sampled_render.h"

namespace stipple::api {

struct RenderSettings {
  RenderOptions options;
  StippleRenderMethod method = STIPPLE_RENDER_TILED;
  bool linearise = false;  ///< the composited values are display values and light is asked for
  const float* splat_light = nullptr;  ///< [H,W,3]
  RenderAccuracy accuracy;             ///< of STIPPLE_RENDER_TILED
  double budget_share = 1;
  bool has_accuracy = false;
  Sampling sampling;
  /// Composited values are display values and stay so, but light is what pictures are averaged in.
  bool averages_light = false;
};

/// The options of the caller in the library's own terms. NULL: defaults.
RenderSettings renderSettings(const StippleRenderOptions* options, const Instances& instances);

/// True when the composited values are display values.
bool compositesInDisplaySpace(const Instances& instances, BlendSpace blend_space);

/// Refuses a surface or light that is not one of the camera's picture.
void validateLayers(const RenderSettings& settings, const Camera& camera);

}  // namespace stipple::api
