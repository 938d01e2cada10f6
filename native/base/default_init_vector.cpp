#include "base/default_init_vector.h"

#include "base/platform/memory.h"

namespace stipple {
namespace {

// Below four huge pages the rounding would cost more memory than the faults cost time.
constexpr size_t kHugeFromBytes = 4 * platform::kHugePageBytes;

}  // namespace

void* allocateArray(size_t bytes) {
  if (bytes < kHugeFromBytes) return ::operator new(bytes);
  constexpr size_t kPage = platform::kHugePageBytes;
  void* memory = platform::allocateOnHugePages((bytes + kPage - 1) / kPage * kPage);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void freeArray(void* memory, size_t bytes) noexcept {
  if (bytes < kHugeFromBytes) {
    ::operator delete(memory);
  } else {
    platform::freeHugePages(memory);
  }
}

}  // namespace stipple
