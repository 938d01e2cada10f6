#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/images/image_channel.h"

namespace stipple {

/// Reads all channels of an EXR file: half, float and integer ones, of any compression, scan lines
/// and tiles, one part or several. A name has its layer in front, "ViewLayer.Depth.Z"; where a part
/// leaves it out, it is the part's name. Integers keep their value, as near as float32 does. What
/// lies outside the data window is 0. In: limit_bytes, what the values may take.
/// Errors: kIo, kFormat (another kind of file, a file that is cut off), kUnsupported (deep pixels),
/// kMemoryLimit, kUnavailable (media library missing).
std::vector<ImageChannel> readImageChannels(const std::string& path,
                                            uint64_t limit_bytes = UINT64_MAX);

}  // namespace stipple
