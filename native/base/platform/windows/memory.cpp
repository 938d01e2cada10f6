#include "base/platform/memory.h"

#include <malloc.h>
#include <windows.h>

namespace stipple::platform {

void* allocateOnHugePages(size_t bytes) {
  return ::_aligned_malloc(bytes, kHugePageBytes);
}

void freeHugePages(void* memory) {
  ::_aligned_free(memory);
}

// Windows gives large pages to programs alone that may lock memory.
void adviseHugePages(void*, size_t) {}

// Pages come with the first write.
void populatePages(void*, size_t) {}

uint64_t machineMemory() {
  MEMORYSTATUSEX status{};
  status.dwLength = sizeof(status);
  if (::GlobalMemoryStatusEx(&status) == 0) return UINT64_MAX;
  return status.ullTotalPhys;
}

}  // namespace stipple::platform
