#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace stipple {

// What a file may ask for. Every reader compares what its file claims with these numbers before it
// allocates; docs/formats.md holds the same table for users, and a test compares the two.

/// How many bytes may be made of a file: `always`, whatever its size, and `per_byte` more for each
/// byte that it has.
struct Allowance {
  uint64_t always;
  uint64_t per_byte;

  /// UINT64_MAX where the product does not fit.
  uint64_t of(uint64_t file_bytes) const;
};

constexpr uint64_t kMebibyte = uint64_t{1} << 20;

/// Splats as float arrays. A byte of real packed scenes becomes 5 to 30 bytes; equal splats pack to
/// almost nothing, and a million of them with all harmonics takes 236 MB.
constexpr Allowance kSplatAllowance = {256 * kMebibyte, 1024};

/// Instances of meshes and of splats in a glTF file, each with arrays of its own. A byte of one mesh
/// becomes about 4 bytes; small files may show it as often as 2 million triangles take.
constexpr Allowance kInstanceAllowance = {256 * kMebibyte, 64};

/// Pixels of one image as float: 8192 x 8192 of four channels from any file, since a blank image
/// packs to almost nothing. Real photographs become 10 to 60 bytes per byte.
constexpr Allowance kImageAllowance = {1024 * kMebibyte, 256};

/// Active voxels of a volume's grid, of 16 bytes each: constant regions are stored as single tiles,
/// and become bricks.
constexpr Allowance kVoxelAllowance = {256 * kMebibyte, 1024};

/// Values of one JSON text nested in each other: copying and printing go as deep by recursion.
constexpr size_t kMaxJsonDepth = 256;
/// Values of one JSON text; each takes 16 to 100 bytes.
constexpr uint64_t kMaxJsonValues = uint64_t{1} << 22;
/// Bytes of a JSON text in a file of its own.
constexpr uint64_t kMaxJsonBytes = 128 * kMebibyte;
/// Bytes of a SOG scene's meta.json, which a zip archive may pack a thousandfold. Real ones have
/// 10 to 30 KB.
constexpr uint64_t kMaxSogMetaBytes = kMebibyte;

/// Refuses what a file asks for where it is more than its size allows. In: name, of the file; what,
/// as a noun in the plural or singular ("its 3 splats").
/// Errors: kFormat with what is asked for and what is allowed.
void requireAllowed(uint64_t asked_bytes, const Allowance& allowance, uint64_t file_bytes,
                    const std::string& name, const std::string& what);

}  // namespace stipple
