#pragma once

#include <cstdint>

#include "base/progress.h"
#include "data/accuracy_report.h"
#include "measure/timing.h"
#include "shot/instances.h"
#include "splat/voxels/voxelize.h"

namespace stipple {

/// What is measured, and how often.
struct VolumeAccuracyOptions {
  VoxelizeOptions finest;  ///< the volume that judges those of larger voxels
  Timing timing = {5, 60};
};

/// Errors: kInvalidArgument for options outside their range, and for instances without splats.
void validate(const VolumeAccuracyOptions& options, const Instances& instances);

/// Fills volumes with voxels of 1 to 8 times the finest size, and compares the light that they send
/// to their sides. In: options, which validate() accepts; memory_limit, bytes of each volume.
/// Errors: those of voxelize().
AccuracyReport measureVolume(const Instances& instances, const VolumeAccuracyOptions& options,
                             uint64_t memory_limit, Progress& progress);

}  // namespace stipple
