#pragma once

#include <atomic>

namespace stipple {

#if defined(__cpp_lib_atomic_ref)
template <typename T>
using AtomicRef = std::atomic_ref<T>;
#else
/// std::atomic_ref as far as it is used here, for libraries of C++ that have none yet (libc++
/// before version 19). In: place: aligned as numbers of its kind are, 4 or 8 bytes.
template <typename T>
class AtomicRef {
 public:
  explicit AtomicRef(T& place) : place_(&place) {}

  T load(std::memory_order) const {
    T value;
    __atomic_load(place_, &value, __ATOMIC_RELAXED);
    return value;
  }
  void store(T value, std::memory_order) const { __atomic_store(place_, &value, __ATOMIC_RELAXED); }
  bool compare_exchange_weak(T& expected, T desired, std::memory_order) const {
    return __atomic_compare_exchange(place_, &expected, &desired, true, __ATOMIC_RELAXED,
                                     __ATOMIC_RELAXED);
  }

 private:
  T* place_;
};
#endif

}  // namespace stipple
