#pragma once

#include "decode/surface/splat_shapes.h"
#include "decode/surface/surface_index.h"
#include "decode/surface/surface_sites.h"

namespace stipple {

/// Moves finished splats into the body that they enclose, so that its silhouette ends where the
/// surface does, and none through a sheet on the other side.
void insetSplats(const SurfaceIndex& index, const SurfaceSites& sites, SplatShapes& shapes);

}  // namespace stipple
