#include <zlib.h>

#include <algorithm>
#include <limits>
#include <string>

#include "base/error.h"
#include "io/media/media_status.h"
#include "io/media/packing/packing_calls.h"

namespace stipple::media {

namespace {

/// zlib counts in 32 bits.
uInt piece(uint64_t bytes) {
  return static_cast<uInt>(std::min<uint64_t>(bytes, std::numeric_limits<uInt>::max()));
}

struct Inflater {
  z_stream stream{};
  Inflater() {
    // Negative: deflate data without zlib's own header.
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) {
      fail(ErrorCode::kOutOfMemory, "zlib cannot start; there is not enough memory");
    }
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

}  // namespace

void stipple_packing_zip_inflate(const char* name, const uint8_t* bytes, uint64_t byte_count,
                                 uint8_t* whole, uint64_t whole_bytes, StippleMediaStatus* status) {
  guard(name, status, [&] {
    Inflater inflater;
    z_stream& stream = inflater.stream;
    // zlib does not write through next_in; its type is older than const.
    stream.next_in = const_cast<Bytef*>(bytes);
    // It refuses a null pointer, which an empty file may bring, even where it has nothing to write.
    uint8_t nothing = 0;
    uint8_t* const out = whole_bytes == 0 ? &nothing : whole;
    stream.next_out = out;
    int result = Z_OK;
    while (result == Z_OK) {
      const auto used = static_cast<uint64_t>(stream.next_in - bytes);
      const auto made = static_cast<uint64_t>(stream.next_out - out);
      stream.avail_in = piece(byte_count - used);
      stream.avail_out = piece(whole_bytes - made);
      result = inflate(&stream, Z_NO_FLUSH);
    }
    const auto made = static_cast<uint64_t>(stream.next_out - out);
    if (result == Z_STREAM_END && made == whole_bytes) return;
    if (result == Z_MEM_ERROR) throw std::bad_alloc();
    fail(ErrorCode::kFormat,
         std::string(name) + " is damaged: its deflate data gives " +
             (result == Z_BUF_ERROR && made == whole_bytes ? "more than " : "") +
             std::to_string(made) + " bytes; the archive says " + std::to_string(whole_bytes));
  });
}

uint32_t stipple_packing_zip_checksum(const uint8_t* bytes, uint64_t byte_count) {
  uLong checksum = crc32(0, nullptr, 0);
  for (uint64_t done = 0; done < byte_count;) {
    const uInt count = piece(byte_count - done);
    checksum = crc32(checksum, bytes + done, count);
    done += count;
  }
  return static_cast<uint32_t>(checksum);
}

}  // namespace stipple::media
