#include "base/fresh_memory.h"

#include <cstdint>

#include "base/parallel.h"
#include "base/platform/memory.h"

namespace stipple {

void populateFresh(void* memory, size_t bytes) {
  constexpr size_t kPage = platform::kHugePageBytes;
  // Below four huge pages the rounding would cost more memory than the faults cost time.
  if (bytes < 4 * kPage) return;
  const auto begin = reinterpret_cast<uintptr_t>(memory);
  // Whole huge pages inside, so that nothing else of the heap changes.
  const uintptr_t first = (begin + kPage - 1) / kPage * kPage;
  const uintptr_t last = (begin + bytes) / kPage * kPage;
  platform::adviseHugePages(reinterpret_cast<void*>(first), last - first);
  parallelFor((last - first) / kPage, 1, [&](size_t page, size_t) {
    platform::populatePages(reinterpret_cast<void*>(first + page * kPage), kPage);
  });
}

}  // namespace stipple
