#pragma once

#include <memory>

#include "data/meshes/point_set.h"
#include "data/meshes/tri_mesh.h"
#include "decode/surface/surface_decoder.h"
#include "density/octree_density.h"
#include "mesh/surface_sampling.h"

namespace stipple {

struct SurfaceModelOptions {
  SurfaceSamplingOptions sampling;
  OctreeDensityOptions density;
};

/// What a mesh becomes: a density over an octree and the surface that its decoder projects to.
struct SurfaceModel {
  std::shared_ptr<const PointSet> surface;
  std::shared_ptr<const OctreeDensity> density;
  std::shared_ptr<const SurfaceDecoder> decoder;
};

SurfaceModel buildSurfaceModel(const TriMesh& mesh, const SurfaceModelOptions& options,
                               Progress* progress = nullptr);

/// The model from its stored parts (an asset file).
SurfaceModel surfaceModelFromParts(std::shared_ptr<const PointSet> surface,
                                   std::shared_ptr<const OctreeDensity> density);

}  // namespace stipple
