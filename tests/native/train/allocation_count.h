#pragma once

#include <cstddef>
#include <functional>

namespace stipple::testing {

/// Calls of operator new in this program so far, by any thread.
size_t allocationCount();

/// The most bytes of operator new that `work` held at once, beside those held before.
size_t mostBytesDuring(const std::function<void()>& work);

}  // namespace stipple::testing
