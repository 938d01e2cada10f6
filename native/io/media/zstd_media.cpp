// Zstandard frames by libzstd.
#include <zstd.h>

#include <memory>
#include <new>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

struct StreamFree {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

}  // namespace

void stipple_media_zstd_unpack(const char* what, const uint8_t* bytes, uint64_t count, uint8_t* out,
                               uint64_t capacity, uint64_t* produced, StippleMediaStatus* status) {
  guard(what, status, [&] {
    // As a stream, so that a frame that goes on after `capacity` bytes is told from a damaged one.
    const std::unique_ptr<ZSTD_DStream, StreamFree> stream(ZSTD_createDStream());
    if (stream == nullptr) throw std::bad_alloc();
    ZSTD_inBuffer in{bytes, static_cast<size_t>(count), 0};
    ZSTD_outBuffer room{out, static_cast<size_t>(capacity), 0};
    size_t left = 1;
    while (left != 0 && room.pos < room.size) {
      const size_t read = in.pos;
      const size_t written = room.pos;
      left = ZSTD_decompressStream(stream.get(), &room, &in);
      if (ZSTD_isError(left)) {
        fail(ErrorCode::kFormat, std::string(what) + " is damaged: its zstd frame of " +
                                     std::to_string(count) + " bytes is wrong near byte " +
                                     std::to_string(in.pos) + " (" + ZSTD_getErrorName(left) + ")");
      }
      if (left != 0 && read == in.pos && written == room.pos) {
        fail(ErrorCode::kFormat, std::string(what) + " is truncated: its zstd frame of " +
                                     std::to_string(count) + " bytes does not end");
      }
    }
    *produced = room.pos;
  });
}

void stipple_media_zstd_pack(const char* what, const uint8_t* bytes, uint64_t count, int32_t level,
                             const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(what, status, [&] {
    std::vector<uint8_t> packed(ZSTD_compressBound(static_cast<size_t>(count)));
    const size_t size =
        ZSTD_compress(packed.data(), packed.size(), bytes, static_cast<size_t>(count), level);
    if (ZSTD_isError(size)) {
      fail(ErrorCode::kInternal,
           std::string(what) + " cannot be packed: " + ZSTD_getErrorName(size));
    }
    giveBytes(*sink, 0, packed.data(), size);
  });
}

}  // namespace stipple::media
