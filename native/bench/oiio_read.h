#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple::bench {

/// What any program that reads pictures has to do, as a floor for data sets: OpenImageIO's own
/// decoding to bytes, as the file has them. Returns [H,W,C].
std::vector<uint8_t> readByOpenImageIo(const std::string& path);

}  // namespace stipple::bench
