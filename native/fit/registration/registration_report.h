#pragma once

#include "base/progress.h"
#include "fit/registration/registration.h"

namespace stipple {

/// Measures how far a template was from its target and is now, where a report is asked for.
void measureRegistration(const TriMesh& given, const RegistrationTarget& target,
                         const RegistrationOptions& options, RegisteredMesh& made,
                         Progress* progress);

}  // namespace stipple
