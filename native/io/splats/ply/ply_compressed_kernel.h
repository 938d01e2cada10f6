#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/splats/ply/ply_compressed.h"

namespace stipple {

/// The packed numbers of a chunk, property by property (kPackedProperties). Behind the last splat
/// of a short chunk any bits do.
using PlyChunkBits = std::array<std::array<uint32_t, kPlyChunkSplats>, kPackedProperties.size()>;

/// What the bits of a chunk stand for, except for scales. Rows behind the last splat are written,
/// too.
struct PlyChunkTarget {
  float* positions;                                              ///< [256,3]
  float* rotations;                                              ///< [256,4] w,x,y,z
  float* opacities;                                              ///< [256]
  std::array<std::array<float, kPlyChunkSplats>, 3>* harmonics;  ///< [3,256] of band 0
};

/// Rows of bytes that stand for harmonics of bands 1 and up.
struct PlyHarmonicRows {
  static constexpr size_t kMostBytes = 45;
  static constexpr size_t kReadable = 48;  ///< bytes from the start of the last row on
  const uint8_t* bytes;                    ///< [count, row_bytes]
  size_t row_bytes;
  size_t count;
  std::array<uint8_t, kMostBytes> from;  ///< where in a row the numbers lie, in the cloud's order
};

/// Logarithms of scales beyond this are moved here: 2 nm and 485,165 km.
constexpr double kPlyLogLimit = 20.0;

/// Numbers of a chunk's splats as a cloud has them, attribute by attribute. Behind the last splat
/// of a short chunk one of its own stands again.
struct PlyChunkValues {
  using Values = std::array<float, kPlyChunkSplats>;
  std::array<Values, 9> ranged;  ///< position, scale, harmonics of band 0
  Values opacity;
  std::array<Values, 4> rotation;  ///< w,x,y,z
};

/// Harmonics of splats that lie anywhere.
struct PlyHarmonicSources {
  const float* const* rows;  ///< [count], each [3 + numbers], of which the first three are band 0
  size_t count;
  size_t numbers;
  std::array<uint8_t, PlyHarmonicRows::kMostBytes> to;  ///< where in a row of bytes each goes
};

/// Loops over chunks and rows for one instruction set; all give the same numbers.
struct PlyChunkKernel {
  const char* target;
  void (*decode)(const PlyChunkBits& bits, const PlyChunkRange& range, const PlyChunkTarget& out);
  /// In: sh [count, 3 + row_bytes], of which the first three of each row are left undefined.
  void (*decodeHarmonics)(const PlyHarmonicRows& rows, float* sh);
  /// The range of a chunk's numbers and the nearest of the even numbers in it. Returns false, and
  /// any bits, where a value is none that validate() lets through.
  bool (*encode)(const PlyChunkValues& values, PlyChunkRange& range, PlyChunkBits& bits);
  /// Out: bytes [count, numbers] and room for 16 more. Returns false, and any bytes, where a
  /// value is not finite.
  bool (*encodeHarmonics)(const PlyHarmonicSources& sources, uint8_t* bytes);
};

PlyChunkKernel plainPlyChunkKernel();

/// The kernels that this machine can run, plain code ("scalar") first.
std::vector<PlyChunkKernel> plyChunkKernels();

/// The best, or the one that STIPPLE_FORCE_TARGET names.
const PlyChunkKernel& plyChunkKernel();

}  // namespace stipple
