// gzip streams by zlib.
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

// 16 asks zlib for a gzip header and trailer around the stream.
constexpr int kGzipWindow = 16 + MAX_WBITS;

/// zlib counts its input and output in unsigned int: longer arrays are handed over in pieces.
uInt piece(uint64_t left) {
  return static_cast<uInt>(std::min<uint64_t>(left, std::numeric_limits<uInt>::max()));
}

struct Inflater {
  z_stream stream{};
  Inflater() {
    if (inflateInit2(&stream, kGzipWindow) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

struct Deflater {
  z_stream stream{};
  explicit Deflater(int level) {
    if (deflateInit2(&stream, level, Z_DEFLATED, kGzipWindow, 9, Z_DEFAULT_STRATEGY) != Z_OK) {
      throw std::bad_alloc();
    }
  }
  ~Deflater() { deflateEnd(&stream); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;
};

}  // namespace

void stipple_media_gzip_unpack(const char* what, const uint8_t* bytes, uint64_t count, uint8_t* out,
                               uint64_t capacity, uint64_t* produced, StippleMediaStatus* status) {
  guard(what, status, [&] {
    Inflater inflater;
    z_stream& stream = inflater.stream;
    uint64_t read = 0;
    uint64_t written = 0;
    int code = Z_OK;
    while (written < capacity && code != Z_STREAM_END) {
      const uInt in = piece(count - read);
      const uInt room = piece(capacity - written);
      stream.next_in = const_cast<Bytef*>(bytes + read);
      stream.avail_in = in;
      stream.next_out = out + written;
      stream.avail_out = room;
      code = inflate(&stream, Z_NO_FLUSH);
      read += in - stream.avail_in;
      written += room - stream.avail_out;
      if (code == Z_MEM_ERROR) throw std::bad_alloc();
      const bool stuck = in == stream.avail_in && room == stream.avail_out;
      if ((code != Z_OK && code != Z_STREAM_END) || (stuck && code == Z_OK)) {
        const bool unfinished = read == count && (code == Z_BUF_ERROR || code == Z_OK);
        fail(ErrorCode::kFormat,
             std::string(what) +
                 (unfinished ? " is truncated: its gzip stream of "
                             : " is damaged: its gzip stream of ") +
                 std::to_string(count) +
                 (unfinished ? " bytes does not end"
                             : " bytes is wrong near byte " + std::to_string(read)) +
                 (stream.msg != nullptr ? std::string(" (") + stream.msg + ")" : std::string()));
      }
    }
    *produced = written;
  });
}

void stipple_media_gzip_pack(const char* what, const uint8_t* bytes, uint64_t count, int32_t level,
                             const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(what, status, [&] {
    Deflater deflater(level);
    z_stream& stream = deflater.stream;
    std::vector<uint8_t> packed;
    uint64_t read = 0;
    size_t written = 0;
    int code = Z_OK;
    while (code != Z_STREAM_END) {
      if (packed.size() - written < (size_t{1} << 16)) {
        packed.resize(std::max<size_t>(packed.size() * 2, size_t{1} << 18));
      }
      const uInt in = piece(count - read);
      const uInt room = piece(packed.size() - written);
      stream.next_in = const_cast<Bytef*>(bytes + read);
      stream.avail_in = in;
      stream.next_out = packed.data() + written;
      stream.avail_out = room;
      code = deflate(&stream, read + in == count ? Z_FINISH : Z_NO_FLUSH);
      read += in - stream.avail_in;
      written += room - stream.avail_out;
      if (code != Z_OK && code != Z_STREAM_END && code != Z_BUF_ERROR) {
        fail(ErrorCode::kInternal,
             std::string(what) + " cannot be packed: zlib reports " + std::to_string(code));
      }
    }
    giveBytes(*sink, 0, packed.data(), written);
  });
}

}  // namespace stipple::media
