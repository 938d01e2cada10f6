#pragma once

#include <stipple/stipple.h>

#include "math/camera.h"
#include "math/camera_text.h"

namespace stipple::api {

/// The camera of the caller in the library's own terms; validate() is left to what uses it.
Camera cameraFrom(const StippleCamera* camera);

/// The other way round; struct_size is left to the caller.
StippleCamera cameraTo(const Camera& camera);

/// Refuses the number of a view that is not there.
void requireView(const StippleViews& views, uint64_t index);

}  // namespace stipple::api
