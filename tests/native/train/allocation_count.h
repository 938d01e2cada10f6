#pragma once

#include <cstddef>

namespace stipple::testing {

/// Calls of operator new in this program so far, by any thread.
size_t allocationCount();

}  // namespace stipple::testing
