#pragma once

#include <stipple/stipple.h>

#include <string>

#include "math/camera.h"

namespace stipple::api {

/// The camera of the caller in the library's own terms; validate() is left to what uses it.
Camera cameraFrom(const StippleCamera* camera);

/// "64 x 48 pixels", for messages.
std::string sizeText(const Camera& camera);

/// The other way round; struct_size is left to the caller.
StippleCamera cameraTo(const Camera& camera);

/// As transforms.json has it: "PINHOLE", "ORTHOGRAPHIC", "EQUIRECTANGULAR", ...
const char* modelName(const Camera& camera);

/// Refuses the number of a view that is not there.
void requireView(const StippleViews& views, uint64_t index);

}  // namespace stipple::api
