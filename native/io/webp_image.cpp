#include "io/webp_image.h"

#include "base/error.h"
#include "io/media_library.h"

namespace stipple {

RgbaBytes decodeWebp(const std::vector<uint8_t>& bytes, uint64_t max_pixels,
                     const std::string& name) {
  const StipplePackingTable& packing = packingTable();
  RgbaBytes image;
  callMedia([&](StippleMediaStatus* status) {
    packing.webp_size(name.c_str(), bytes.data(), bytes.size(), &image.width, &image.height,
                      status);
  });
  if (image.pixelCount() > max_pixels) {
    fail(ErrorCode::kFormat, name + " has " + std::to_string(image.width) + " x " +
                                 std::to_string(image.height) + " pixels; at most " +
                                 std::to_string(max_pixels) + " belong there");
  }
  image.bytes.resize(static_cast<size_t>(image.pixelCount() * 4));
  callMedia([&](StippleMediaStatus* status) {
    packing.webp_decode(name.c_str(), bytes.data(), bytes.size(), image.bytes.data(),
                        image.bytes.size(), status);
  });
  return image;
}

std::vector<uint8_t> encodeWebp(const RgbaBytes& image, const std::string& name) {
  std::vector<uint8_t> bytes;
  const MediaSink sink([&bytes](uint32_t, uint64_t count) -> void* {
    bytes.resize(static_cast<size_t>(count));
    return bytes.data();
  });
  const StipplePackingTable& packing = packingTable();
  callMedia([&](StippleMediaStatus* status) {
    packing.webp_encode(name.c_str(), image.bytes.data(), image.width, image.height, sink.get(),
                        status);
  });
  return bytes;
}

}  // namespace stipple
