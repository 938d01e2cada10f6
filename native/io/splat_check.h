#pragma once

#include <string>

#include "data/splat_cloud.h"

namespace stipple {

/// validate() with all threads; messages are the same.
void validateInParallel(const SplatCloud& cloud, const char* what);

/// Refuses a cloud with values that no splat can have, as a fault of the file that it was read
/// from. Errors: kFormat with the file, the splat, the value seen and what is allowed.
void requireValidSplats(const SplatCloud& cloud, const std::string& path);

}  // namespace stipple
