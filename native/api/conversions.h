#pragma once

#include <stipple/stipple.h>

#include <memory>
#include <string>

#include "api/guard.h"
#include "api/handles.h"
#include "data/views/view_source.h"
#include "fit/fit_options.h"
#include "io/splats/splat_format.h"
#include "shot/passes.h"
#include "shot/shot_settings.h"
#include "splat/voxels/voxelize.h"

// Structs of the caller in the library's own terms: conversions that several files share. What is
// outside the range of its type is refused with kInvalidArgument and the argument's name; what the
// values mean together is for the rooms to refuse.

namespace stipple::api {

/// NULL: defaults.
SplatWriteOptions writeOptions(const StippleCloudSaveOptions* options);

ColourGrade gradeFrom(const StippleGrade& grade, const char* name);

Instances instancesFrom(const StippleInstance* instances, uint64_t count);

/// What is not given is that of the level; validate() has accepted all. In: given, not NULL.
AccuracySettings accuracyFrom(const StippleAccuracy* given, const char* name);
StippleAccuracy accuracyTo(const AccuracySettings& accuracy);

/// NULL: defaults.
ShotSettings shotFrom(const StippleRenderOptions* options, const Instances& instances);

/// NULL: defaults.
VoxelizeOptions voxelizeOptionsFrom(const StippleVoxelizeOptions* options);

/// Refuses what a file held where the memory limit leaves no room for it.
void requireRoom(const SplatCloud& cloud, const std::string& path, const MemoryLimit& limit);

/// The images of views. Errors: kInvalidArgument where there are cameras alone.
std::shared_ptr<const ViewSource> sourceOf(const StippleViews& views);

/// In: options as a caller gave them; null, and what a shorter struct lacks, are the defaults.
FitOptions fitOptionsFrom(const StippleFitOptions* options);

}  // namespace stipple::api
