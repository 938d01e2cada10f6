#pragma once

#include <cstddef>

namespace stipple {

/// Has the system make pages of memory that nobody has written yet: of 2 MiB where it has them, by
/// all threads. Small memory stays as it is.
void populateFresh(void* memory, size_t bytes);

/// resize() of a vector that was empty. The first touch of a page of 4 KiB takes longer than
/// filling it, and one thread would touch all of them.
template <typename Vector>
void resizeFresh(Vector& values, size_t count) {
  if (values.empty() && count > values.capacity()) {
    values.reserve(count);
    populateFresh(values.data(), count * sizeof(typename Vector::value_type));
  }
  values.resize(count);
}

}  // namespace stipple
