#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace stipple {

/// A little-endian number at any address.
template <typename T>
T loadLittleEndian(const void* address) {
  static_assert(std::is_unsigned_v<T>);
  const auto* bytes = static_cast<const uint8_t*>(address);
  T value = 0;
  for (size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | static_cast<T>(bytes[i]) << (8 * i));
  return value;
}

inline float loadFloat(const void* address) {
  return std::bit_cast<float>(loadLittleEndian<uint32_t>(address));
}

template <typename T>
void storeLittleEndian(T value, void* address) {
  static_assert(std::is_unsigned_v<T>);
  auto* bytes = static_cast<uint8_t*>(address);
  for (size_t i = 0; i < sizeof(T); ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
}

inline void storeFloat(float value, void* address) {
  storeLittleEndian(std::bit_cast<uint32_t>(value), address);
}

}  // namespace stipple
