#pragma once

#include <stipple/stipple.h>

#include <memory>
#include <vector>

#include "splat/render/render.h"

namespace stipple::api {

/// The placed clouds of a call, with shares that keep the clouds alive while a job runs.
struct Instances {
  std::vector<std::shared_ptr<const SplatCloud>> shares;
  std::vector<SplatInstance> list;
};

/// In: name of the argument in the header. Errors: kInvalidArgument for values outside their range.
ColourGrade gradeFrom(const StippleGrade& grade, const char* name);

Instances instancesFrom(const StippleInstance* instances, uint64_t count);

}  // namespace stipple::api
