#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stipple {

// The layout of a compressed PLY, shared by reader and writer; docs/formats.md has it in words.

constexpr size_t kPlyChunkSplats = 256;
constexpr double kPlyChunkC0 = 0.28209479177387814;

/// Lowest and highest position, logarithm of the scale, and colour of a chunk's splats.
constexpr size_t kPlyChunkNumbers = 18;
using PlyChunkRange = std::array<float, kPlyChunkNumbers>;
constexpr std::array<const char*, kPlyChunkNumbers> kChunkProperties = {
    "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
    "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
    "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};

constexpr std::array<const char*, 4> kPackedProperties = {"packed_position", "packed_rotation",
                                                          "packed_scale", "packed_color"};

/// Harmonics are bytes: -4 and 4 at the ends, the middles of 256 equal parts between.
inline double plyHarmonicOf(uint8_t byte) {
  const double share = byte == 0 ? 0.0 : byte == 255 ? 1.0 : (byte + 0.5) / 256.0;
  return (share - 0.5) * 8.0;
}

}  // namespace stipple
