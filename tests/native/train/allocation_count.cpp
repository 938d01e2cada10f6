#include "train/allocation_count.h"

#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<size_t> count{0};
std::atomic<size_t> held_bytes{0};
std::atomic<size_t> most_bytes{0};

/// Null where there is no memory.
void* countedIfPossible(size_t bytes, size_t alignment) {
  ++count;
  // aligned_alloc wants a multiple of the alignment, malloc's own is enough for small ones.
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(bytes ? bytes : 1)
          : std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (!memory) return nullptr;
  const size_t held = held_bytes += malloc_usable_size(memory);
  size_t most = most_bytes;
  while (held > most && !most_bytes.compare_exchange_weak(most, held)) {
  }
  return memory;
}

void* counted(size_t bytes, size_t alignment) {
  void* memory = countedIfPossible(bytes, alignment);
  if (!memory) throw std::bad_alloc();
  return memory;
}

void release(void* memory) {
  held_bytes -= malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace

namespace stipple::testing {

size_t allocationCount() {
  return count;
}

size_t mostBytesDuring(const std::function<void()>& work) {
  const size_t before = held_bytes;
  most_bytes = before;
  work();
  return most_bytes - before;
}

}  // namespace stipple::testing

void* operator new(size_t bytes) {
  return counted(bytes, 1);
}
void* operator new(size_t bytes, std::align_val_t alignment) {
  return counted(bytes, static_cast<size_t>(alignment));
}
// std::stable_sort calls it. The usual one calls the first above, but those of sanitizers do not.
void* operator new(size_t bytes, const std::nothrow_t&) noexcept {
  return countedIfPossible(bytes, 1);
}
void operator delete(void* memory) noexcept {
  release(memory);
}
void operator delete(void* memory, size_t) noexcept {
  release(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  release(memory);
}
void operator delete(void* memory, size_t, std::align_val_t) noexcept {
  release(memory);
}
