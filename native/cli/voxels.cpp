#include "cli/voxels.h"

#include <string>

#include "cli/commands.h"

namespace stipple::cli {

StippleVoxelizeOptions voxelizeOptions(double voxel_size, int64_t resolution) {
  if (resolution < 1 || resolution > 65536) {
    throw Failure("--resolution is " + std::to_string(resolution) + "; 1 to 65536 is allowed");
  }
  StippleVoxelizeOptions options;
  stipple_voxelize_options_init(&options);
  options.voxel_size = voxel_size;
  options.resolution = static_cast<uint32_t>(resolution);
  return options;
}

Volume voxelized(const Context& context, const Cloud& cloud,
                 const StippleVoxelizeOptions& options) {
  auto instance = sized<StippleInstance>();
  instance.cloud = cloud.get();
  for (int i = 0; i < 4; ++i) instance.matrix[i * 5] = 1.0;
  const auto job = make<Job>(stipple_voxelize_start, context.get(),
                             const_cast<const StippleInstance*>(&instance), uint64_t{1}, &options);
  finish(job);
  return make<Volume>(stipple_job_volume, job.get());
}

}  // namespace stipple::cli
