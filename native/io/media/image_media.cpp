// Pictures through OpenImageIO. It would multiply and divide by alpha on its own, at 8 bits with
// loss; it is told to leave the values alone, and the caller converts.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/bytes/limits.h"
#include "io/media/media_calls.h"

namespace stipple::media {

namespace {

// 2^28 pixels of four float32 channels are 4 GiB.
constexpr uint64_t kMaxPixels = uint64_t{1} << 28;

/// Which channels of the file become grey, RGB or RGBA.
std::vector<int> chooseChannels(const OIIO::ImageSpec& spec) {
  const auto find = [&spec](const char* name) { return spec.channelindex(name); };
  std::vector<int> chosen = {find("R"), find("G"), find("B")};
  if (chosen[0] < 0 || chosen[1] < 0 || chosen[2] < 0) {
    if (spec.nchannels <= 2) {
      chosen = spec.nchannels == 1 ? std::vector<int>{0} : std::vector<int>{0, 0, 0};
    } else {
      chosen = {0, 1, 2};
    }
  }
  const int alpha = spec.alpha_channel >= 0                        ? spec.alpha_channel
                    : (spec.nchannels == 2 || spec.nchannels == 4) ? spec.nchannels - 1
                                                                   : -1;
  const bool separate = std::find(chosen.begin(), chosen.end(), alpha) == chosen.end();
  if (alpha >= 0 && alpha < spec.nchannels && separate) {
    if (chosen.size() == 1) chosen = {chosen[0], chosen[0], chosen[0]};
    chosen.push_back(alpha);
  }
  return chosen;
}

/// What the header says, where that is a picture that can be read.
StippleMediaImage describe(const OIIO::ImageSpec& spec, const std::string& name) {
  const int64_t window[2] = {spec.full_width > 0 ? spec.full_width : spec.width,
                             spec.full_height > 0 ? spec.full_height : spec.height};
  for (const int64_t side : {window[0], window[1], int64_t{spec.width}, int64_t{spec.height}}) {
    if (side < 1 || side > 65536) {
      fail(ErrorCode::kFormat, name + " is " + std::to_string(window[0]) + " x " +
                                   std::to_string(window[1]) +
                                   " pixels; each side must be 1 to 65536");
    }
  }
  const auto area = [](int64_t w, int64_t h) { return static_cast<uint64_t>(w * h); };
  if (std::max(area(window[0], window[1]), area(spec.width, spec.height)) > kMaxPixels ||
      spec.nchannels < 1 || spec.depth > 1) {
    fail(ErrorCode::kFormat, name + " is " + std::to_string(window[0]) + " x " +
                                 std::to_string(window[1]) + " pixels; at most " +
                                 std::to_string(kMaxPixels) + " flat pixels can be read");
  }
  StippleMediaImage info{};
  info.width = static_cast<uint32_t>(window[0]);
  info.height = static_cast<uint32_t>(window[1]);
  info.channels = static_cast<uint32_t>(chooseChannels(spec).size());
  info.is_display = spec.format.is_floating_point() ? 0 : 1;
  // Readers that kept straight alpha, as told, say so; others (WebP in version 2.4) multiply.
  info.alpha_is_associated = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0 ? 0 : 1;
  info.bits = static_cast<uint32_t>(spec.format.size() * 8);
  return info;
}

/// Room for this many floats.
using Allocate = std::function<float*(size_t count)>;

/// Decodes the pixels [height, width, channels] to where `allocate` says.
StippleMediaImage decodeInto(OIIO::ImageInput& input, const std::string& name,
                             const ImagesSoFar& others, const Allocate& allocate) {
  const OIIO::ImageSpec spec = input.spec();
  const StippleMediaImage info = describe(spec, name);
  const int64_t window[2] = {info.width, info.height};
  const std::vector<int> channels = chooseChannels(spec);
  const int first = *std::min_element(channels.begin(), channels.end());
  const int last = *std::max_element(channels.begin(), channels.end());
  const auto read_channels = static_cast<size_t>(last - first + 1);
  const auto data_floats =
      static_cast<uint64_t>(spec.width) * static_cast<uint64_t>(spec.height) * read_channels;
  const uint64_t pixel_floats = uint64_t{info.width} * info.height * channels.size();
  requireAllowed(others.pixel_bytes + std::max(data_floats, pixel_floats) * sizeof(float),
                 kImageAllowance, others.encoded_bytes, name,
                 "an image of " + std::to_string(info.width) + " x " +
                     std::to_string(info.height) + " pixels");
  const auto read = [&](float* pixels) {
    if (!input.read_image(0, 0, first, last + 1, OIIO::TypeDesc::FLOAT, pixels)) {
      fail(ErrorCode::kFormat, name + " cannot be decoded: " + input.geterror());
    }
  };
  const size_t count = static_cast<size_t>(window[0] * window[1]) * channels.size();
  // Most pictures lie in their files as they are wanted; a copy takes as long as a tenth of
  // decoding.
  bool as_wanted = spec.x == spec.full_x && spec.y == spec.full_y && spec.width == window[0] &&
                   spec.height == window[1];
  for (size_t c = 0; c < channels.size(); ++c) {
    as_wanted = as_wanted && channels[c] == first + static_cast<int>(c);
  }
  if (as_wanted) {
    read(allocate(count));
    return info;
  }

  const size_t width = static_cast<size_t>(spec.width);
  const size_t height = static_cast<size_t>(spec.height);
  std::vector<float> pixels(width * height * read_channels);
  read(pixels.data());
  float* out = allocate(count);
  std::fill_n(out, count, 0.0f);
  // The data window may be smaller or larger than the picture.
  for (size_t y = 0; y < height; ++y) {
    const int64_t row = spec.y - spec.full_y + static_cast<int64_t>(y);
    if (row < 0 || row >= window[1]) continue;
    for (size_t x = 0; x < width; ++x) {
      const int64_t column = spec.x - spec.full_x + static_cast<int64_t>(x);
      if (column < 0 || column >= window[0]) continue;
      const float* from = &pixels[(y * width + x) * read_channels];
      float* to = out + static_cast<size_t>(row * window[0] + column) * channels.size();
      for (size_t c = 0; c < channels.size(); ++c) to[c] = from[channels[c] - first];
    }
  }
  return info;
}

OIIO::ImageSpec keepAlpha() {
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  return config;
}

std::unique_ptr<OIIO::ImageInput> openImage(const std::string& path) {
  const OIIO::ImageSpec config = keepAlpha();
  auto input = OIIO::ImageInput::open(path, &config);
  if (!input) {
    fail(ErrorCode::kFormat, path + " is not an image that can be read: " + OIIO::geterror());
  }
  return input;
}

/// The name under which OpenImageIO finds the reader of these bytes.
const char* nameForBytes(const std::vector<unsigned char>& bytes) {
  const auto starts = [&bytes](const char* magic, size_t length) {
    return bytes.size() >= length && std::memcmp(bytes.data(), magic, length) == 0;
  };
  if (starts("\x89PNG", 4)) return "texture.png";
  if (starts("\xff\xd8", 2)) return "texture.jpg";
  if (starts("RIFF", 4)) return "texture.webp";
  if (starts("BM", 2)) return "texture.bmp";
  if (starts("GIF8", 4)) return "texture.gif";
  return nullptr;
}

/// Copies bytes of a file from an offset, all inside it.
using ReadAt = std::function<void(uint64_t offset, uint8_t* out, size_t count)>;

/// Refuses a PNG of which a chunk says that it goes on beyond the end: its reader would ask for
/// that much memory, up to 2 GiB, before it looks. Other files are fine. In: size, of the file.
void requireWholeChunks(uint64_t size, const ReadAt& read_at, const std::string& name) {
  constexpr uint64_t kSignature = 8;
  constexpr uint64_t kAround = 12;  // length, type and checksum of a chunk
  std::array<uint8_t, 8> head;
  if (size < head.size()) return;
  read_at(0, head.data(), head.size());
  if (std::memcmp(head.data(), "\x89PNG", 4) != 0) return;
  for (uint64_t at = kSignature; at + kAround <= size;) {
    read_at(at, head.data(), head.size());
    uint64_t length = 0;
    for (size_t i = 0; i < 4; ++i) length = length << 8 | head[i];
    const uint64_t left = size - at - kAround;
    if (length > left) {
      fail(ErrorCode::kFormat, name + " cannot be decoded: a part of it says that it has " +
                                   std::to_string(length) + " bytes, and " + std::to_string(left) +
                                   " are left");
    }
    if (std::memcmp(&head[4], "IEND", 4) == 0) return;
    at += kAround + length;
  }
}

void write(const char* path, const OIIO::ImageSpec& spec, OIIO::TypeDesc type, const void* pixels) {
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path);
  if (!output) {
    fail(ErrorCode::kUnsupported, std::string(path) + " cannot be written: " + OIIO::geterror());
  }
  // Into memory first: on a full disk OpenImageIO ends a PNG file early and says nothing.
  OIIO::Filesystem::IOVecOutput bytes;
  if (!output->set_ioproxy(&bytes) || !output->open(path, spec) ||
      !output->write_image(type, pixels) || !output->close()) {
    fail(ErrorCode::kIo, std::string(path) + " cannot be written: " + output->geterror());
  }
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.buffer().data()),
             static_cast<std::streamsize>(bytes.buffer().size()));
  finishFile(file, path);
}

OIIO::ImageSpec specFor(const StippleMediaImage& image, OIIO::TypeDesc type) {
  OIIO::ImageSpec spec(static_cast<int>(image.width), static_cast<int>(image.height),
                       static_cast<int>(image.channels), type);
  if (image.channels == 1) spec.channelnames = {"Y"};
  return spec;
}

}  // namespace

DecodedImage decodeImageBytes(const std::vector<unsigned char>& bytes, const std::string& name,
                              const ImagesSoFar& others) {
  const char* file_name = nameForBytes(bytes);
  if (file_name == nullptr) {
    fail(ErrorCode::kUnsupported, name + " is not a PNG, JPEG, WebP, BMP or GIF image");
  }
  requireWholeChunks(
      bytes.size(),
      [&bytes](uint64_t at, uint8_t* out, size_t count) { std::copy_n(&bytes[at], count, out); },
      name);
  OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
  OIIO::ImageSpec config = keepAlpha();
  // The readers look for the bytes in the configuration, not in open's own argument.
  void* proxy = &memory;
  config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
  const auto input = OIIO::ImageInput::open(file_name, &config, &memory);
  if (!input) fail(ErrorCode::kFormat, name + " cannot be decoded: " + OIIO::geterror());
  DecodedImage image;
  image.info = decodeInto(*input, name, others, [&image](size_t count) {
    image.pixels.resize(count);
    return image.pixels.data();
  });
  return image;
}

void stipple_media_image_read(const char* path, StippleMediaImage* image,
                              const StippleMediaSink* sink, StippleMediaStatus* status) {
  guard(path, status, [&] {
    const InputFile file(path);
    requireWholeChunks(
        file.size(),
        [&file](uint64_t at, uint8_t* out, size_t count) { file.readAt(at, out, count); }, path);
    *image = decodeInto(*openImage(path), path, {0, file.size()}, [sink](size_t count) {
      return static_cast<float*>(
          stipple::media::allocate(*sink, kMediaPixels, count * sizeof(float)));
    });
  });
}

void stipple_media_image_header(const char* path, StippleMediaImage* image,
                                StippleMediaStatus* status) {
  guard(path, status, [&] { *image = describe(openImage(path)->spec(), path); });
}

void stipple_media_png_write(const char* path, const StippleMediaImage* image,
                             const uint8_t* pixels, StippleMediaStatus* status) {
  guard(path, status, [&] {
    OIIO::ImageSpec spec = specFor(*image, OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    spec.attribute("oiio:ColorSpace", "sRGB");
    write(path, spec, OIIO::TypeDesc::UINT8, pixels);
  });
}

void stipple_media_exr_write(const char* path, const StippleMediaImage* image, const float* pixels,
                             StippleMediaStatus* status) {
  guard(path, status, [&] {
    OIIO::ImageSpec spec = specFor(*image, OIIO::TypeDesc::FLOAT);
    spec.attribute("compression", "zip");
    write(path, spec, OIIO::TypeDesc::FLOAT, pixels);
  });
}

}  // namespace stipple::media
