#pragma once

#include <charconv>
#include <type_traits>

namespace stipple {

/// What readNumber() does for numbers with a point where the library of C++ does not: the same, by
/// the C library, whose locale changes nothing.
std::from_chars_result readByParts(const char* begin, const char* end, float& value);
std::from_chars_result readByParts(const char* begin, const char* end, double& value);

/// std::from_chars, which libc++ before version 20 has for whole numbers alone.
template <typename Number>
std::from_chars_result readNumber(const char* begin, const char* end, Number& value) {
#if !defined(__cpp_lib_to_chars)
  if constexpr (std::is_floating_point_v<Number>) {
    return readByParts(begin, end, value);
  } else  // NOLINT
#endif
    return std::from_chars(begin, end, value);
}

}  // namespace stipple
