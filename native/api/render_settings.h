#pragma once

#include <stipple/stipple.h>

#include "api/instances.h"
#include "splat/render.h"

namespace stipple::api {

struct RenderSettings {
  RenderOptions options;
  StippleRenderMethod method = STIPPLE_RENDER_TILED;
  bool linearise = false;  ///< the composited values are display values and light is asked for
};

/// The options of the caller in the library's own terms. NULL: defaults.
RenderSettings renderSettings(const StippleRenderOptions* options, const Instances& instances);

}  // namespace stipple::api
