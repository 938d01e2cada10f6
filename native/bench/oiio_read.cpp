#include "bench/oiio_read.h"

#include <OpenImageIO/imageio.h>

#include <stdexcept>

namespace stipple::bench {

std::vector<uint8_t> readByOpenImageIo(const std::string& path) {
  const auto input = OIIO::ImageInput::open(path);
  if (!input) throw std::runtime_error(path + ": " + OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  std::vector<uint8_t> pixels(static_cast<size_t>(spec.image_pixels()) *
                              static_cast<size_t>(spec.nchannels));
  if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, pixels.data())) {
    throw std::runtime_error(path + ": " + input->geterror());
  }
  return pixels;
}

}  // namespace stipple::bench
