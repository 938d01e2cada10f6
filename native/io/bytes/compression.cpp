#include "io/bytes/compression.h"

#include "io/media_library.h"

namespace stipple {

size_t unpackBytes(Compression compression, const uint8_t* bytes, size_t count, uint8_t* out,
                   size_t capacity, const std::string& what) {
  const StipplePackingTable& packing = packingTable();
  uint64_t produced = 0;
  callMedia([&](StippleMediaStatus* status) {
    const auto unpack =
        compression == Compression::kGzip ? packing.gzip_unpack : packing.zstd_unpack;
    unpack(what.c_str(), bytes, count, out, capacity, &produced, status);
  });
  return static_cast<size_t>(produced);
}

ByteVector packBytes(Compression compression, const uint8_t* bytes, size_t count, int level,
                     const std::string& what) {
  const StipplePackingTable& packing = packingTable();
  ByteVector packed;
  const MediaSink sink([&packed](uint32_t, uint64_t size) -> void* {
    packed.resize(static_cast<size_t>(size));
    return packed.data();
  });
  callMedia([&](StippleMediaStatus* status) {
    const auto pack = compression == Compression::kGzip ? packing.gzip_pack : packing.zstd_pack;
    pack(what.c_str(), bytes, count, level, sink.get(), status);
  });
  return packed;
}

}  // namespace stipple
