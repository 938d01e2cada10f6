#include "decode/surface/surface_model.h"

#include "base/error.h"

namespace stipple {

SurfaceModel buildSurfaceModel(const TriMesh& mesh, const SurfaceModelOptions& options,
                               Progress* progress) {
  auto surface = std::make_shared<const PointSet>(sampleSurface(mesh, options.sampling, progress));
  auto density = std::make_shared<const OctreeDensity>(
      OctreeDensity::fromPoints(surface->positions, surface->weights, options.density));
  return surfaceModelFromParts(std::move(surface), std::move(density));
}

SurfaceModel surfaceModelFromParts(std::shared_ptr<const PointSet> surface,
                                   std::shared_ptr<const OctreeDensity> density) {
  if (!surface || !density) {
    fail(ErrorCode::kInvalidArgument, "surface model: the surface or the density is missing");
  }
  SurfaceModel model;
  model.decoder =
      std::make_shared<const SurfaceDecoder>(surface, density->root(), density->leafLevel());
  model.surface = std::move(surface);
  model.density = std::move(density);
  return model;
}

}  // namespace stipple
