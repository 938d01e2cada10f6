#pragma once

#include <cstddef>

#include "base/default_init_vector.h"

namespace stipple {

/// An array that is filled anew for every picture: it never copies what it held, never initialises,
/// and only grows, to exactly the size that was asked for.
template <typename T>
class ReusedArray {
 public:
  /// Forgets the contents.
  T* resize(size_t count) {
    if (count > values_.capacity()) {
      values_ = {};  // before the new memory is taken
      values_.reserve(count);
    }
    values_.resize(count);
    return values_.data();
  }
  T* get() { return values_.data(); }
  const T* get() const { return values_.data(); }
  T& operator[](size_t i) { return values_[i]; }
  const T& operator[](size_t i) const { return values_[i]; }
  size_t size() const { return values_.size(); }
  size_t bytes() const { return values_.capacity() * sizeof(T); }

 private:
  DefaultInitVector<T> values_;
};

}  // namespace stipple
