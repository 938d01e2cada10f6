#pragma once

#include <cstdint>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/splats/splat_format.h"

namespace stipple {

/// Reads .splat: records of 32 bytes without a header, as antimatter15's viewer has them.
SplatCloud readSplat32(const std::string& path, Progress* progress);

/// Writes .splat. A file without records is none, so an empty cloud is refused.
void writeSplat32(const SplatCloud& cloud, const std::string& path,
                  const SplatWriteOptions& options, Progress* progress);
double estimateSplat32(uint64_t count, int degree, const SplatWriteOptions& options);

}  // namespace stipple
