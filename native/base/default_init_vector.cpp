#include "base/default_init_vector.h"

#include <sys/mman.h>

#include <cstdlib>

namespace stipple {
namespace {

// Below four huge pages the rounding would cost more memory than the faults cost time.
constexpr size_t kHugePageBytes = size_t{2} << 20;
constexpr size_t kHugeFromBytes = 4 * kHugePageBytes;

}  // namespace

void* allocateArray(size_t bytes) {
  if (bytes < kHugeFromBytes) return ::operator new(bytes);
  const size_t rounded = (bytes + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  void* memory = std::aligned_alloc(kHugePageBytes, rounded);
  if (memory == nullptr) throw std::bad_alloc();
  madvise(memory, rounded, MADV_HUGEPAGE);  // advice only: refused where there are no huge pages
  return memory;
}

void freeArray(void* memory, size_t bytes) noexcept {
  if (bytes < kHugeFromBytes) {
    ::operator delete(memory);
  } else {
    std::free(memory);
  }
}

}  // namespace stipple
