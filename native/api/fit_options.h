#pragma once

#include <stipple/stipple.h>

#include "fit/fit_options.h"

namespace stipple::api {

/// In: options as a caller gave them; null, and what a shorter struct lacks, are the defaults.
FitOptions fitOptionsFrom(const StippleFitOptions* options);

}  // namespace stipple::api
