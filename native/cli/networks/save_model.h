#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "cli/library.h"
#include "cli/report.h"

namespace stipple::cli {

/// Refuses a name that is neither of splats nor of a model. Errors: Failure.
void requireModelOrSplats(const std::string& out);

/// Writes the model that a job has made, or its splats at a budget; without one, at the model's
/// own. In: prefix: of the figures that go into the report. Returns the seconds of decoding, 0 for
/// a model.
double saveModelOf(const Job& job, const std::string& out, const std::optional<int64_t>& anchors,
                   const std::string& prefix, Report& report);

}  // namespace stipple::cli
