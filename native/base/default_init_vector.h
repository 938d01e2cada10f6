#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace stipple {

/// Bytes for a large array whose elements the caller writes first; on pages of 2 MiB where the
/// system has them. Throws std::bad_alloc.
void* allocateArray(size_t bytes);
void freeArray(void* memory, size_t bytes) noexcept;

/// Leaves trivial elements uninitialised on resize, so that the threads that fill a large array are
/// the first to touch its pages: zeroing 240 MB on one thread costs as much as sampling 10 M
/// anchors on two.
template <class T>
class DefaultInitAllocator {
 public:
  static_assert(std::is_trivially_copyable_v<T>);
  using value_type = T;

  DefaultInitAllocator() = default;
  template <class U>
  DefaultInitAllocator(const DefaultInitAllocator<U>&) noexcept {}

  T* allocate(size_t count) {
    if (count > static_cast<size_t>(-1) / 2 / sizeof(T)) throw std::bad_alloc();
    return static_cast<T*>(allocateArray(count * sizeof(T)));
  }
  void deallocate(T* memory, size_t count) noexcept { freeArray(memory, count * sizeof(T)); }

  template <class U>
  void construct(U* at) noexcept {
    ::new (static_cast<void*>(at)) U;
  }
  template <class U, class... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    ::new (static_cast<void*>(at)) U(std::forward<Arguments>(arguments)...);
  }

  friend bool operator==(const DefaultInitAllocator&, const DefaultInitAllocator&) { return true; }
};

/// A std::vector whose resize(count) leaves new elements uninitialised.
template <class T>
using DefaultInitVector = std::vector<T, DefaultInitAllocator<T>>;

}  // namespace stipple
