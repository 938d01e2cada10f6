#pragma once

#include <cstdint>

namespace stipple {

/// How often a thing is timed.
struct Timing {
  uint32_t repetitions = 7;  ///< 1 to 1000
  double most_seconds = 60;  ///< after which no further round begins; above 0
};

/// Errors: kInvalidArgument.
void validate(const Timing& timing);

}  // namespace stipple
