#pragma once

#include <cstddef>
#include <functional>

namespace stipple {

/// Runs body(begin, end) over [0, count) in ranges of at most `grain` elements whose bounds do not
/// depend on the number of threads. The thread limit is that of the surrounding ThreadLimit.
/// An exception thrown by a body leaves this function.
void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body);

/// Number of ranges parallelFor makes, and so of partial results to merge in order.
inline size_t rangeCount(size_t count, size_t grain) { return (count + grain - 1) / grain; }

/// The most threads that a parallelFor called from here uses.
size_t threadLimit();

/// Runs `body` with at most thread_count threads (0: as many as the machine has).
void withThreads(unsigned thread_count, const std::function<void()>& body);

}  // namespace stipple
