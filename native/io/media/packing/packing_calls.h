#pragma once

#include <cstdint>

#include "io/media_table.h"

namespace stipple::media {

// The entries of the table. Nothing is thrown across it: each runs its work in `guard`.
extern "C" {
void stipple_packing_gzip_unpack(const char* what, const uint8_t* bytes, uint64_t count,
                                 uint8_t* out, uint64_t capacity, uint64_t* produced,
                                 StippleMediaStatus* status);
void stipple_packing_gzip_pack(const char* what, const uint8_t* bytes, uint64_t count,
                               int32_t level, const StippleMediaSink* sink,
                               StippleMediaStatus* status);
void stipple_packing_zstd_unpack(const char* what, const uint8_t* bytes, uint64_t count,
                                 uint8_t* out, uint64_t capacity, uint64_t* produced,
                                 StippleMediaStatus* status);
void stipple_packing_zstd_pack(const char* what, const uint8_t* bytes, uint64_t count,
                               int32_t level, const StippleMediaSink* sink,
                               StippleMediaStatus* status);
void stipple_packing_webp_size(const char* name, const uint8_t* bytes, uint64_t byte_count,
                               uint32_t* width, uint32_t* height, StippleMediaStatus* status);
void stipple_packing_webp_decode(const char* name, const uint8_t* bytes, uint64_t byte_count,
                                 uint8_t* rgba, uint64_t rgba_bytes, StippleMediaStatus* status);
void stipple_packing_webp_encode(const char* name, const uint8_t* rgba, uint32_t width,
                                 uint32_t height, const StippleMediaSink* sink,
                                 StippleMediaStatus* status);
void stipple_packing_zip_inflate(const char* name, const uint8_t* bytes, uint64_t byte_count,
                                 uint8_t* whole, uint64_t whole_bytes, StippleMediaStatus* status);
uint32_t stipple_packing_zip_checksum(const uint8_t* bytes, uint64_t byte_count);
}

}  // namespace stipple::media
