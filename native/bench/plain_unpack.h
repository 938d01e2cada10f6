#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "bench/plain_file.h"
#include "data/clouds/splat_cloud.h"

namespace stipple::bench {

// For a format of packed numbers, making float32 arrays of its bits is what unpacking a stream is
// for others: no reader of the file gets around it. These loops do that and nothing else: no
// checks, no exponential or logarithm, no rotation brought to length 1, no order of splats; blocks
// of rows on all threads, as the compiler makes them from plain code.

/// The arrays of a cloud, not filled.
struct PlainArrays {
  PlainArrays(size_t count, size_t sh_stride);
  PlainBytes positions, rotations, scales, opacities, sh;
};

/// A compressed PLY of `count` splats as our writer lays it out, to arrays; and back.
PlainArrays unpackCompressedPly(const PlainBytes& file, size_t count, int degree);
PlainBytes packCompressedPly(const SplatCloud& cloud, size_t file_bytes);

/// The splats along a curve through space, by std::sort on one thread: what the format's chunks
/// want of a writer beside packing, as a chunk of splats from everywhere spans everything.
std::vector<std::pair<uint64_t, uint32_t>> sortPlainly(const SplatCloud& cloud);

/// Records of 32 bytes, to arrays; and back.
PlainArrays unpackSplat32(const PlainBytes& file);
PlainBytes packSplat32(const SplatCloud& cloud);

}  // namespace stipple::bench
