#pragma once

#include <string>

#include "math/camera.h"

namespace stipple {

/// "64 x 48 pixels", for messages.
std::string sizeText(const Camera& camera);

/// As transforms.json has it: "PINHOLE", "ORTHOGRAPHIC", "EQUIRECTANGULAR", ...
const char* modelName(const Camera& camera);

}  // namespace stipple
