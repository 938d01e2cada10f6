#pragma once

#include <memory>

#include "decode/surface/surface_model.h"
#include "model/splat_model.h"

namespace stipple {

/// The kind "surface": splats on the surface of a mesh, with anchors drawn from a density on it.
std::shared_ptr<const SplatModel> makeSurfaceSplats(SurfaceModel surface, ModelNotes notes = {});

}  // namespace stipple
