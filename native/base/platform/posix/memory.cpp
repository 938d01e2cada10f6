#include "base/platform/memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>

namespace stipple::platform {

void* allocateOnHugePages(size_t bytes) {
  void* memory = std::aligned_alloc(kHugePageBytes, bytes);
  if (memory != nullptr) adviseHugePages(memory, bytes);
  return memory;
}

void freeHugePages(void* memory) {
  std::free(memory);
}

void adviseHugePages(void* memory, size_t bytes) {
#ifdef MADV_HUGEPAGE
  // Refused where there are no huge pages.
  madvise(memory, bytes, MADV_HUGEPAGE);
#else
  static_cast<void>(memory), static_cast<void>(bytes);
#endif
}

void populatePages(void* memory, size_t bytes) {
#ifdef MADV_POPULATE_WRITE
  madvise(memory, bytes, MADV_POPULATE_WRITE);
#else
  static_cast<void>(memory), static_cast<void>(bytes);
#endif
}

uint64_t machineMemory() {
  const long pages = sysconf(_SC_PHYS_PAGES);
  const long page_bytes = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page_bytes <= 0) return UINT64_MAX;
  return static_cast<uint64_t>(pages) * static_cast<uint64_t>(page_bytes);
}

}  // namespace stipple::platform
