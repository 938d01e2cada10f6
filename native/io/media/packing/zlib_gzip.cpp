// gzip streams by zlib.
#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/media/media_status.h"
#include "io/media/packing/packing_calls.h"

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

/// Bytes that one thread packs at a time. Each piece knows the 32 KiB before it, so that hardly
/// anything is lost by the cuts.
constexpr uint64_t kPiece = uint64_t{1} << 19;
constexpr uint64_t kWindow = uint64_t{1} << 15;
constexpr int kRawWindow = -15;  ///< deflate data without a header

struct Deflater {
  z_stream stream{};
  explicit Deflater(int level) {
    if (deflateInit2(&stream, level, Z_DEFLATED, kRawWindow, 9, Z_DEFAULT_STRATEGY) != Z_OK) {
      throw std::bad_alloc();
    }
  }
  ~Deflater() { deflateEnd(&stream); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;
};

/// The deflate data of one piece, which ends at a whole byte.
std::vector<uint8_t> packedPiece(const char* what, const uint8_t* bytes, uint64_t count,
                                 uint64_t before, bool is_last, int level) {
  Deflater deflater(level);
  z_stream& stream = deflater.stream;
  const uint64_t known = std::min(before, kWindow);
  if (known > 0) deflateSetDictionary(&stream, bytes - known, static_cast<uInt>(known));
  // The bound holds for one call; a flush adds a few bytes.
  std::vector<uint8_t> packed(deflateBound(&stream, static_cast<uLong>(count)) + 16);
  stream.next_in = const_cast<Bytef*>(bytes);
  stream.avail_in = static_cast<uInt>(count);
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  const int code = deflate(&stream, is_last ? Z_FINISH : Z_SYNC_FLUSH);
  if (code != (is_last ? Z_STREAM_END : Z_OK) || stream.avail_in != 0 || stream.avail_out == 0) {
    fail(ErrorCode::kInternal,
         std::string(what) + " cannot be packed: zlib reports " + std::to_string(code));
  }
  packed.erase(packed.end() - static_cast<std::ptrdiff_t>(stream.avail_out), packed.end());
  return packed;
}

}  // namespace

void stipple_packing_gzip_unpack(const char* what, const uint8_t* bytes, uint64_t count,
                                 uint8_t* out, uint64_t capacity, uint64_t* produced,
                                 StippleMediaStatus* status) {
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

void stipple_packing_gzip_pack(const char* what, const uint8_t* bytes, uint64_t count,
                               int32_t level, const StippleMediaSink* sink,
                               StippleMediaStatus* status) {
  guard(what, status, [&] {
    const uint64_t piece_count = std::max<uint64_t>(1, (count + kPiece - 1) / kPiece);
    std::vector<std::vector<uint8_t>> pieces(piece_count);
    std::vector<uLong> sums(piece_count);
    const auto sizeOf = [&](uint64_t i) { return std::min(kPiece, count - i * kPiece); };
    parallelFor(piece_count, 1, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const uint8_t* start = bytes + i * kPiece;
        pieces[i] = packedPiece(what, start, sizeOf(i), i * kPiece, i + 1 == piece_count, level);
        sums[i] = crc32(0, start, static_cast<uInt>(sizeOf(i)));
      }
    });
    // RFC 1952: magic, deflate, no flags, no time, no extra flags, written by an unknown system.
    std::vector<uint8_t> packed = {0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255};
    uLong sum = sums[0];
    for (uint64_t i = 0; i < piece_count; ++i) {
      packed.insert(packed.end(), pieces[i].begin(), pieces[i].end());
      pieces[i] = std::vector<uint8_t>();
      if (i > 0) sum = crc32_combine(sum, sums[i], static_cast<z_off_t>(sizeOf(i)));
    }
    for (const uint64_t number : {uint64_t{sum}, count}) {
      for (int b = 0; b < 4; ++b) packed.push_back(static_cast<uint8_t>(number >> (8 * b)));
    }
    giveBytes(*sink, 0, packed.data(), packed.size());
  });
}

}  // namespace stipple::media
