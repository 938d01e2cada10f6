#pragma once

namespace stipple::testing {

/// Lets invalid operations, divisions by zero and overflows raise SIGFPE in this thread and those
/// that it starts. Does nothing under the sanitizers, or where the processor has no traps.
void enableTraps();

/// nullptr where traps are on, else why they are not.
const char* whyNoTraps();

}  // namespace stipple::testing
