#include "base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace stipple {

void parallelFor(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
  if (count == 0) return;
  const size_t ranges = rangeCount(count, grain);
  if (ranges == 1) {
    body(0, count);
    return;
  }
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, ranges, 1),
      [&](const tbb::blocked_range<size_t>& range) {
        for (size_t i = range.begin(); i < range.end(); ++i) {
          body(i * grain, std::min(count, (i + 1) * grain));
        }
      },
      tbb::simple_partitioner());
}

size_t threadLimit() {
  return static_cast<size_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
}

void withThreads(unsigned thread_count, const std::function<void()>& body) {
  tbb::task_arena arena(thread_count == 0 ? tbb::task_arena::automatic
                                          : static_cast<int>(thread_count));
  // Isolated: a thread that waits for this work must not pick up tasks of the application (Cycles
  // shares the process-wide pool) and stay away for seconds.
  arena.execute([&] { tbb::this_task_arena::isolate(body); });
}

}  // namespace stipple
