#include "measure/timing.h"

#include <cmath>
#include <cstdio>
#include <string>

#include "base/error.h"

namespace stipple {

void validate(const Timing& timing) {
  if (timing.repetitions < 1 || timing.repetitions > 1000) {
    fail(
        ErrorCode::kInvalidArgument,
        "options->repetitions is " + std::to_string(timing.repetitions) + "; 1 to 1000 is allowed");
  }
  if (!(timing.most_seconds > 0 && std::isfinite(timing.most_seconds))) {
    char seconds[32];
    std::snprintf(seconds, sizeof(seconds), "%.3g", timing.most_seconds);
    fail(ErrorCode::kInvalidArgument,
         std::string("options->max_seconds is ") + seconds + " s; more than 0 is allowed");
  }
}

}  // namespace stipple
