#pragma once

#include <cstdint>
#include <functional>

#include "io/media_table.h"

namespace stipple {

/// The calls of libstipple_media, which is opened at the first use: it lies in the folder of this
/// library, or for a program in ../lib or ../../lib of it. It stays loaded.
/// Errors: kUnavailable with the loader's reason; a later call tries again.
const StippleMediaTable& mediaTable();

/// The calls of libstipple_packing, likewise. It is a library of its own, because it needs zlib,
/// Zstandard and libwebp alone, and the libraries behind images and volumes take far longer to load
/// than a file of splats to unpack.
const StipplePackingTable& packingTable();

/// Runs one call of a table and throws what it reports as an Error.
void callMedia(const std::function<void(StippleMediaStatus*)>& call);

/// A sink around a function(array, bytes) → address; an exception in it leaves as null.
class MediaSink {
 public:
  using Allocate = std::function<void*(uint32_t array, uint64_t bytes)>;
  explicit MediaSink(Allocate allocate);
  const StippleMediaSink* get() const { return &sink_; }
  MediaSink(const MediaSink&) = delete;
  MediaSink& operator=(const MediaSink&) = delete;

 private:
  Allocate allocate_;
  StippleMediaSink sink_;
};

}  // namespace stipple
