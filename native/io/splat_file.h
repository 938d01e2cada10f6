#pragma once

#include <string>

#include "base/progress.h"
#include "data/splat_cloud.h"

namespace stipple {

/// Reads a splat file; the format is told by its first bytes, then by its ending.
/// Errors: kIo (cannot be opened), kFormat (what is wrong and where), kUnsupported.
SplatCloud readSplatFile(const std::string& path, Progress* progress = nullptr);

struct SplatWriteOptions {
  bool ascii = false;  ///< PLY: text instead of little-endian binary
};

/// Writes by the ending of the path (.ply); under a temporary name, then renamed.
void writeSplatFile(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress = nullptr);

}  // namespace stipple
