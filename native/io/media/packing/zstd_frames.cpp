// Zstandard frames by libzstd.
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/media/media_status.h"
#include "io/media/packing/packing_calls.h"

namespace stipple::media {

namespace {

/// Bytes that a worker takes at a time. Each knows some of those before; of a file of splats, cuts
/// so near to each other cost less than 0.01 % of its size.
constexpr int kJobBytes = 1 << 21;

struct PackerFree {
  void operator()(ZSTD_CCtx* packer) const { ZSTD_freeCCtx(packer); }
};

struct StreamFree {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

}  // namespace

void stipple_packing_zstd_unpack(const char* what, const uint8_t* bytes, uint64_t count,
                                 uint8_t* out, uint64_t capacity, uint64_t* produced,
                                 StippleMediaStatus* status) {
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

void stipple_packing_zstd_pack(const char* what, const uint8_t* bytes, uint64_t count,
                               int32_t level, const StippleMediaSink* sink,
                               StippleMediaStatus* status) {
  guard(what, status, [&] {
    const std::unique_ptr<ZSTD_CCtx, PackerFree> packer(ZSTD_createCCtx());
    if (packer == nullptr) throw std::bad_alloc();
    ZSTD_CCtx_setParameter(packer.get(), ZSTD_c_compressionLevel, level);
    // The frame does not depend on how many workers there are, only on whether there are any. A
    // library that was built without them packs on this thread.
    const auto workers = static_cast<int>(threadLimit());
    ZSTD_CCtx_setParameter(packer.get(), ZSTD_c_nbWorkers, std::max(1, workers));
    ZSTD_CCtx_setParameter(packer.get(), ZSTD_c_jobSize, kJobBytes);
    std::vector<uint8_t> packed(ZSTD_compressBound(static_cast<size_t>(count)));
    const size_t size = ZSTD_compress2(packer.get(), packed.data(), packed.size(), bytes,
                                       static_cast<size_t>(count));
    if (ZSTD_isError(size)) {
      fail(ErrorCode::kInternal,
           std::string(what) + " cannot be packed: " + ZSTD_getErrorName(size));
    }
    giveBytes(*sink, 0, packed.data(), size);
  });
}

}  // namespace stipple::media
