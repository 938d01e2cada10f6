#pragma once

#include <array>
#include <cstdint>

namespace stipple {

/// Spreads the lower 21 bits of x to every third bit.
inline uint64_t spreadBits3(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  x = (x | x << 2) & 0x1249249249249249ull;
  return x;
}

inline uint32_t compactBits3(uint64_t x) {
  x &= 0x1249249249249249ull;
  x = (x | x >> 2) & 0x10c30c30c30c30c3ull;
  x = (x | x >> 4) & 0x100f00f00f00f00full;
  x = (x | x >> 8) & 0x1f0000ff0000ffull;
  x = (x | x >> 16) & 0x1f00000000ffffull;
  x = (x | x >> 32) & 0x1fffff;
  return static_cast<uint32_t>(x);
}

/// Morton code of integer cell coordinates (each below 2^21), x fastest: child k = dx + 2 dy + 4 dz
/// of cell c has code 8 c + k.
inline uint64_t mortonEncode(uint32_t x, uint32_t y, uint32_t z) {
  return spreadBits3(x) | spreadBits3(y) << 1 | spreadBits3(z) << 2;
}

inline std::array<uint32_t, 3> mortonDecode(uint64_t code) {
  return {compactBits3(code), compactBits3(code >> 1), compactBits3(code >> 2)};
}

}  // namespace stipple
