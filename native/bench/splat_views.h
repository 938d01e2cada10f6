#pragma once

#include <cstddef>
#include <memory>

#include "bench/splat_scene.h"
#include "data/views/view_source.h"

namespace stipple::bench {

/// Pictures of the scene from places beside each other, with alpha. Points are its splats.
std::shared_ptr<const ViewSource> viewsOf(const SplatCase& c, size_t count);

}  // namespace stipple::bench
