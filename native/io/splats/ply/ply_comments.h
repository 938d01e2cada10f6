#pragma once

#include <string>
#include <vector>

#include "data/clouds/splat_cloud.h"

namespace stipple {

/// Takes filter, colour space and frame from the comments of a PLY header. Returns whether one
/// names the filter. `path` names the file in messages. Errors: kUnsupported for values that are
/// unknown.
bool readPlyComments(const std::vector<std::string>& comments, const std::string& path,
                     SplatCloud& cloud);

/// The lines of a header that say the same ("comment ...\n" each).
std::string plyComments(const SplatCloud& cloud);

}  // namespace stipple
