#pragma once

#include <string>

#include "cli/library.h"

// What commands have in common that make other splats of splats.

namespace stipple::cli {

/// Refuses a name that is not one of splats. Errors: Failure.
void requireSplats(const std::string& out);

/// Writes the splats that a job has made, and prints how many there are and were.
void saveReplaced(const Job& job, const Cloud& before, const std::string& out, bool as_json);

}  // namespace stipple::cli
