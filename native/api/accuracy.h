#pragma once

#include <stipple/stipple.h>

#include "splat/render/accurate_render.h"

namespace stipple::api {

/// An accuracy of the caller that validateAccuracy accepts, with every field.
StippleAccuracy accuracyFrom(const StippleAccuracy* given, const char* name);

/// What the renderer makes of it; budget, harmonics and low-pass are the caller's business.
RenderAccuracy renderAccuracy(const StippleAccuracy& accuracy);

}  // namespace stipple::api
