#include "api/volume.h"

#include <utility>

#include "api/guard.h"
#include "api/handles.h"
#include "api/instances.h"
#include "api/job.h"
#include "io/volume_file.h"
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
    for (const float density : voxels.density) {
      if (density > 0) ++out.active_voxel_count;
      out.max_density = std::max(out.max_density, static_cast<double>(density));
    }
    for (size_t b = 0; b < voxels.bricks.size(); ++b) {
      for (size_t axis = 0; axis < 3; ++axis) {
        // Half a voxel beyond the centres of the first and last voxel of the brick.
        const double low = voxels.origin[axis] + voxels.voxel_size * (voxels.bricks[b][axis] - 0.5);
        const double high = low + voxels.voxel_size * kBrickSide;
        out.bounds_min[axis] = b == 0 ? low : std::min(out.bounds_min[axis], low);
        out.bounds_max[axis] = b == 0 ? high : std::max(out.bounds_max[axis], high);
      }
    }
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

}  // extern "C"
