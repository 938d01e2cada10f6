#pragma once

#include <string>

#include "cli/library.h"
#include "cli/report.h"

namespace stipple::cli {

/// Compares the files of a folder (empty: the context's) with the published ones, which reads them:
/// as lines for people, or among the figures.
void addWeights(const Context& context, const std::string& folder, bool json, Report& report);

}  // namespace stipple::cli
