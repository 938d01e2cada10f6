#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/default_init_vector.h"

namespace stipple {

using ByteVector = DefaultInitVector<uint8_t>;

/// How bytes are packed. Both go through libstipple_packing.
enum class Compression : uint32_t { kGzip = 0, kZstd = 1 };

/// Unpacks one stream into out [capacity] and stops there, whatever the stream goes on to hold: the
/// caller says how many bytes its counts allow. Returns the number of bytes written; fewer than
/// capacity means that the stream ended. `what` names the stream in messages ("FILE: positions").
/// Errors: kFormat for a damaged or unfinished stream, kUnavailable.
size_t unpackBytes(Compression compression, const uint8_t* bytes, size_t count, uint8_t* out,
                   size_t capacity, const std::string& what);

/// Packs bytes as one stream. In: level, of the library that does it (gzip 1..9, zstd 1..19).
ByteVector packBytes(Compression compression, const uint8_t* bytes, size_t count, int level,
                     const std::string& what);

}  // namespace stipple
