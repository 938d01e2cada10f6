#pragma once

#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Reads .ksplat of version 0.1, with its three levels of compression and sections of buckets.
SplatCloud readKsplat(const std::string& path, Progress* progress);

}  // namespace stipple
