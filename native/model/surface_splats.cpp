#include "model/surface_splats.h"

#include <utility>

#include "base/error.h"
#include "data/position_bounds.h"
#include "io/assets/surface_asset.h"
#include "model/stored_octree.h"

namespace stipple {

namespace {

constexpr uint32_t kMaximumGaussiansPerAnchor = 32;

class SurfaceSplats final : public SplatModel {
 public:
  SurfaceSplats(SurfaceModel surface, ModelNotes notes)
      : surface_(std::move(surface)), notes_(std::move(notes)) {}

  const char* kind() const override { return kAssetSurface; }

  ModelInfo info() const override {
    ModelInfo info;
    info.leaf_level = surface_.density->leafLevel();
    info.leaf_count = surface_.density->leafCount();
    info.sample_count = surface_.surface->size();
    fillBounds(surface_.surface->positions, info.bounds_min.data(), info.bounds_max.data());
    return info;
  }

  std::shared_ptr<const DensityModel> density() const override { return surface_.density; }

  void save(const std::string& path) const override {
    SurfaceAsset asset;
    asset.settings_json = notes_.settings_json;
    asset.extras = notes_.extras;
    static_cast<OctreeTensors&>(asset) = storedOctree(*surface_.density);
    asset.surface = *surface_.surface;
    writeSurfaceAsset(asset, path);
  }

 protected:
  const Decoder& decoder() const override { return *surface_.decoder; }

  void limit(ModelSettings& settings) const override {
    settings.maximum_gaussians_per_anchor = kMaximumGaussiansPerAnchor;
  }

 private:
  SurfaceModel surface_;
  ModelNotes notes_;
};

}  // namespace

std::shared_ptr<const SplatModel> makeSurfaceSplats(SurfaceModel surface, ModelNotes notes) {
  return std::make_shared<const SurfaceSplats>(std::move(surface), std::move(notes));
}

std::shared_ptr<const SplatModel> readSurfaceSplats(const std::string& path, const ReadingAid&) {
  SurfaceAsset asset = readSurfaceAsset(path);
  ModelNotes notes = {std::move(asset.settings_json), std::move(asset.extras)};
  try {
    std::shared_ptr<const OctreeDensity> density = octreeFromStored(asset);
    auto surface = std::make_shared<const PointSet>(std::move(asset.surface));
    return makeSurfaceSplats(surfaceModelFromParts(std::move(surface), std::move(density)),
                             std::move(notes));
  } catch (const Error& error) {
    fail(ErrorCode::kFormat, path + ": " + error.what());
  }
}

}  // namespace stipple
