#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/progress.h"
#include "data/clouds/splat_cloud.h"
#include "io/bytes/compression.h"
#include "io/splats/splat_format.h"

namespace stipple {

bool startsAsSpz(const SplatFileStart& start);

/// Reads SPZ of versions 1 to 4, degrees 0 to 4, with its coordinate system.
SplatCloud readSpzSplats(const std::string& path, Progress* progress);

/// The same of a file in memory. In: what, which messages call it.
SplatCloud readSpzBytes(ByteVector bytes, const std::string& what, Progress* progress);

/// Writes version 3 or 4 (the default). Another frame than RUB takes version 4, whose extension
/// SPZ_ADOBE_coordinate_system says so.
void writeSpzSplats(const SplatCloud& cloud, const std::string& path,
                    const SplatWriteOptions& options, Progress* progress);

/// About how many bytes that is; the streams are packed, so scenes differ.
double estimateSpzSplats(uint64_t count, int degree, const SplatWriteOptions& options);

// The layout, shared by reader and writer; docs/formats.md has it in words.
constexpr uint32_t kSpzMagic = 0x5053474e;  // "NGSP"
constexpr uint32_t kSpzNewestVersion = 4;
constexpr size_t kSpzOldHeaderBytes = 16;
constexpr size_t kSpzHeaderBytes = 32;
constexpr size_t kSpzStreamEntryBytes = 16;
constexpr uint8_t kSpzAntialiased = 1;
constexpr uint8_t kSpzHasExtensions = 2;
constexpr uint32_t kSpzCoordinateSystem = 0xadbe0003;
constexpr size_t kSpzArrayCount = 6;  ///< positions, alphas, colours, scales, rotations, harmonics
/// Colour byte = coefficient * 0.15 * 255 + 127.5.
constexpr double kSpzColourScale = 0.15;

/// Bytes per splat of the array `array` (in the order above).
size_t spzBytesPerSplat(size_t array, uint32_t version, int degree);

}  // namespace stipple
