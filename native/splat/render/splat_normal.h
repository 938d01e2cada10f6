#pragma once

#include "splat/render/scene.h"

namespace stipple {

/// The shortest axis of splat `index` of its cloud, as far as it turns to the camera, in the world;
/// of equal ones the first. Unit.
Vec3d splatNormal(const PlacedScene& scene, const PlacedCloud& placed, size_t index);

}  // namespace stipple
