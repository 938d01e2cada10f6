#include <algorithm>
#include <utility>

#include "api/conversions.h"
#include "api/job.h"
#include "io/volume_file.h"
#include "io/volume_surface.h"
#include "mesh/edge_pairs.h"
#include "mesh/surface_pieces.h"
#include "splat/voxels/voxelize.h"

using namespace stipple;
using namespace stipple::api;

namespace stipple::api {

VoxelizeOptions voxelizeOptionsFrom(const StippleVoxelizeOptions* options) {
  StippleVoxelizeOptions defaults;
  stipple_voxelize_options_init(&defaults);
  const StippleVoxelizeOptions given = completed(options, defaults, "options");
  VoxelizeOptions settings;
  settings.voxel_size = given.voxel_size;
  settings.resolution = given.resolution;
  settings.low_pass = given.low_pass;
  settings.cut_off_sigma = given.cut_off_sigma;
  settings.min_density = given.min_density;
  return settings;
}

}  // namespace stipple::api

namespace {

StippleVolumeToMeshOptions completeOptions(const StippleVolumeToMeshOptions* options) {
  StippleVolumeToMeshOptions defaults;
  stipple_volume_to_mesh_options_init(&defaults);
  return completed(options, defaults, "options");
}

/// Per metre: the density of a voxel of this opacity.
double thresholdOf(const StippleVolumeToMeshOptions& options, const SparseVolume& volume) {
  if (options.density != 0.0) return options.density;
  if (!(options.opacity > 0.0 && options.opacity < 1.0)) {
    fail(ErrorCode::kInvalidArgument,
         "opacity is " + std::to_string(options.opacity) + "; a number between 0 and 1 is allowed");
  }
  return densityOfOpacity(options.opacity, volume.voxel_size);
}

}  // namespace

extern "C" {

void stipple_voxelize_options_init(StippleVoxelizeOptions* options) {
  if (!options) return;
  const VoxelizeOptions defaults;
  *options = {};
  options->struct_size = sizeof(StippleVoxelizeOptions);
  options->resolution = defaults.resolution;
  options->voxel_size = defaults.voxel_size;
  options->low_pass = defaults.low_pass;
  options->cut_off_sigma = defaults.cut_off_sigma;
  options->min_density = defaults.min_density;
}

StippleStatus stipple_voxelize_start(StippleContext* context, const StippleInstance* instances,
                                     uint64_t count, const StippleVoxelizeOptions* options,
                                     StippleJob** job) {
  return guarded([&] {
    require(context, "context");
    require(job, "job");
    Instances placed = instancesFrom(instances, count);
    const VoxelizeOptions settings = voxelizeOptionsFrom(options);
    const uint64_t limit = context->state->memory_limit_bytes;
    *job = startJob(context->state,
                    [placed = std::move(placed), settings, limit](Progress& progress) -> JobResult {
                      return std::make_shared<const SparseVolume>(
                          voxelize(placed.list, settings, limit, &progress));
                    });
  });
}

StippleStatus stipple_voxelize_memory_bound(StippleContext* context,
                                            const StippleInstance* instances, uint64_t count,
                                            const StippleVoxelizeOptions* options,
                                            uint64_t* bytes) {
  return guarded([&] {
    require(context, "context");
    const Instances placed = instancesFrom(instances, count);
    require(bytes, "bytes") = voxelizeMemoryBound(placed.list, voxelizeOptionsFrom(options));
  });
}

void stipple_volume_free(StippleVolume* volume) {
  delete volume;
}

StippleStatus stipple_volume_info(const StippleVolume* volume, StippleVolumeInfo* info) {
  return guarded([&] {
    const SparseVolume& voxels = *require(volume, "volume").volume;
    StippleVolumeInfo out = {};
    out.brick_count = voxels.brickCount();
    out.voxel_size = voxels.voxel_size;
    const VolumeExtent extent = extentOf(voxels);
    out.active_voxel_count = extent.active_voxel_count;
    out.max_density = extent.max_density;
    std::copy(extent.lowest.begin(), extent.lowest.end(), out.bounds_min);
    std::copy(extent.highest.begin(), extent.highest.end(), out.bounds_max);
    deliver(info, out, "info");
  });
}

StippleStatus stipple_volume_save(const StippleVolume* volume, const char* path_utf8) {
  return guarded([&] {
    writeVolumeFile(*require(volume, "volume").volume, &require(path_utf8, "path_utf8"));
  });
}

StippleStatus stipple_volume_load(StippleContext* context, const char* path_utf8,
                                  StippleVolume** volume) {
  return guarded([&] {
    require(context, "context");
    require(volume, "volume");
    const std::string path = &require(path_utf8, "path_utf8");
    *volume = new StippleVolume{context->state,
                                std::make_shared<const SparseVolume>(readVolumeFile(path))};
  });
}

void stipple_volume_to_mesh_options_init(StippleVolumeToMeshOptions* options) {
  if (!options) return;
  *options = {};
  options->struct_size = sizeof(StippleVolumeToMeshOptions);
  options->largest_only = 0;
  options->opacity = 0.5;
  options->density = 0.0;
  options->adaptivity = 0.0;
}

StippleStatus stipple_volume_to_mesh_start(const StippleVolume* volume,
                                           const StippleVolumeToMeshOptions* options,
                                           StippleJob** job) {
  return guarded([&] {
    require(volume, "volume");
    require(job, "job");
    const auto voxels = volume->volume;
    const StippleVolumeToMeshOptions given = completeOptions(options);
    const double threshold = voxels->brickCount() == 0 ? 1.0 : thresholdOf(given, *voxels);
    volume->context->requireMemory(surfaceMemoryBound(*voxels, threshold), "the mesh of a volume");
    *job = startJob(volume->context, [voxels, given, threshold](Progress& progress) -> JobResult {
      advance(&progress, 0.0, "Finding the surface");
      PolygonSurface surface = surfaceOfVolume(*voxels, threshold, given.adaptivity);
      advance(&progress, 0.8, "Making triangles");
      auto mesh = std::make_shared<TriMesh>(triangulated(surface));
      surface = {};
      progress.throwIfCancelled();
      pairEdges(*mesh);
      if (given.largest_only != 0) keepLargestPiece(*mesh, &progress);
      return std::shared_ptr<const TriMesh>(std::move(mesh));
    });
  });
}

StippleStatus stipple_volume_to_mesh_memory_bound(const StippleVolume* volume,
                                                  const StippleVolumeToMeshOptions* options,
                                                  uint64_t* bytes) {
  return guarded([&] {
    const SparseVolume& voxels = *require(volume, "volume").volume;
    const StippleVolumeToMeshOptions given = completeOptions(options);
    const double threshold = voxels.brickCount() == 0 ? 1.0 : thresholdOf(given, voxels);
    require(bytes, "bytes") = surfaceMemoryBound(voxels, threshold);
  });
}

}  // extern "C"
