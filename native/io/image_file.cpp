#include "io/image_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/bytes/input_file.h"
#include "io/bytes/output_file.h"
#include "io/media_library.h"
#include "math/colour.h"

namespace stipple {

namespace {

constexpr size_t kPixelsPerTask = 65536;

void validateImage(const Image& image) {
  if (image.width < 1 || image.width > 65536 || image.height < 1 || image.height > 65536) {
    fail(ErrorCode::kInvalidArgument, "image is " + std::to_string(image.width) + " x " +
                                          std::to_string(image.height) +
                                          " pixels; each side must be 1 to 65536");
  }
  if (image.channels != 1 && image.channels != 3 && image.channels != 4) {
    fail(ErrorCode::kInvalidArgument,
         "image has " + std::to_string(image.channels) + " channels; 1, 3 or 4 are allowed");
  }
  if (image.pixels.size() != image.pixelCount() * image.channels) {
    fail(ErrorCode::kInvalidArgument,
         "image.pixels holds " + std::to_string(image.pixels.size()) + " values; " +
             std::to_string(image.pixelCount() * image.channels) + " are needed");
  }
}

StippleMediaImage infoOf(const Image& image) {
  StippleMediaImage info{};
  info.width = image.width;
  info.height = image.height;
  info.channels = image.channels;
  return info;
}

/// Refuses a JPEG file without its end marker: its decoder fills what is missing with grey and says
/// nothing.
void requireWholeJpeg(const InputFile& file) {
  const uint64_t size = file.size();
  uint8_t ends[4] = {};
  if (size < 4) return;
  file.readAt(0, ends, 2);
  file.readAt(size - 2, ends + 2, 2);
  if (ends[0] != 0xff || ends[1] != 0xd8) return;
  if (ends[2] == 0xff && ends[3] == 0xd9) return;
  // Some programs append to the picture. Its end comes after the first scan; in a scan every byte
  // 255 that is data is followed by 0. Before it, a preview may have an end of its own.
  std::vector<uint8_t> bytes(static_cast<size_t>(size));
  file.readAt(0, bytes.data(), bytes.size());
  size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == 0xff && bytes[at + 1] != 0xda) {
    at += bytes[at + 1] == 0xff ? 1 : size_t{2} + (size_t{bytes[at + 2]} << 8) + bytes[at + 3];
  }
  for (; at + 1 < bytes.size(); ++at) {
    if (bytes[at] == 0xff && bytes[at + 1] == 0xd9) return;
  }
  fail(ErrorCode::kFormat, file.path() + " is cut off: it is " + std::to_string(size) +
                               " bytes long and has no end marker, as JPEG files do");
}

ImageHeader headerOf(const StippleMediaImage& info) {
  ImageHeader header;
  header.width = info.width;
  header.height = info.height;
  header.channels = info.channels;
  header.bits = info.bits;
  header.transfer = info.is_display != 0 ? Transfer::kSrgb : Transfer::kLinear;
  return header;
}

/// Straight display colour 0..1, clamped: what 8 bits can hold.
uint8_t toByte(float value) {
  // Not a number becomes 0.
  const float clamped = value > 0.0f ? std::min(value, 1.0f) : 0.0f;
  return static_cast<uint8_t>(std::lround(clamped * 255.0f));
}

void writePng(const Image& image, const std::string& path, bool keep_values) {
  const bool encode = image.transfer == Transfer::kLinear && !keep_values;
  std::vector<uint8_t> bytes(image.pixels.size());
  const size_t channels = image.channels;
  const size_t colours = channels == 4 ? 3 : channels;
  parallelFor(image.pixelCount(), kPixelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* pixel = &image.pixels[i * channels];
      // Where nothing covers the pixel its colour has no meaning; it is written as it stands.
      const float alpha = channels == 4 && pixel[3] > 0.0f ? pixel[3] : 1.0f;
      for (size_t c = 0; c < colours; ++c) {
        const float straight = pixel[c] / alpha;
        bytes[i * channels + c] = toByte(encode ? linearToSrgb(straight) : straight);
      }
      if (channels == 4) bytes[i * channels + 3] = toByte(pixel[3]);
    }
  });
  const StippleMediaTable& media = mediaTable();
  const StippleMediaImage info = infoOf(image);
  writeByLibrary(path, [&](const char* temporary) {
    callMedia([&](StippleMediaStatus* status) {
      media.png_write(temporary, &info, bytes.data(), status);
    });
  });
}

/// Display sRGB → linear. The transfer function belongs to the straight colour.
std::vector<float> linearPixels(const Image& image) {
  std::vector<float> pixels(image.pixels.size());
  const size_t channels = image.channels;
  parallelFor(image.pixelCount(), kPixelsPerTask, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* from = &image.pixels[i * channels];
      float* to = &pixels[i * channels];
      const float alpha = channels == 4 && from[3] > 0.0f ? from[3] : 1.0f;
      for (size_t c = 0; c < std::min<size_t>(channels, 3); ++c) {
        to[c] = srgbToLinear(from[c] / alpha) * alpha;
      }
      if (channels == 4) to[3] = from[3];
    }
  });
  return pixels;
}

void writeExr(const Image& image, const std::string& path, bool keep_values) {
  const bool decode = image.transfer == Transfer::kSrgb && !keep_values;
  const std::vector<float> converted = decode ? linearPixels(image) : std::vector<float>();
  const StippleMediaTable& media = mediaTable();
  const StippleMediaImage info = infoOf(image);
  writeByLibrary(path, [&](const char* temporary) {
    callMedia([&](StippleMediaStatus* status) {
      media.exr_write(temporary, &info, decode ? converted.data() : image.pixels.data(), status);
    });
  });
}

}  // namespace

ImageHeader readImageHeader(const std::string& path) {
  { const InputFile file(path); }
  StippleMediaImage info{};
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) { media.image_header(path.c_str(), &info, status); });
  return headerOf(info);
}

Image readImageFile(const std::string& path, ImageHeader* header) {
  // Names a missing or unreadable file in the words of every reader.
  requireWholeJpeg(InputFile(path));
  Image image;
  const MediaSink sink([&image](uint32_t array, uint64_t bytes) -> void* {
    if (array != kMediaPixels) return nullptr;
    image.pixels.resize(static_cast<size_t>(bytes / sizeof(float)));
    return image.pixels.data();
  });
  StippleMediaImage info{};
  const StippleMediaTable& media = mediaTable();
  callMedia([&](StippleMediaStatus* status) {
    media.image_read(path.c_str(), &info, sink.get(), status);
  });
  const ImageHeader read = headerOf(info);
  image.width = read.width;
  image.height = read.height;
  image.channels = read.channels;
  image.transfer = read.transfer;
  if (header) *header = read;
  if (image.channels == 4 && info.alpha_is_associated == 0) {
    parallelFor(image.pixelCount(), kPixelsPerTask, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        float* pixel = &image.pixels[i * 4];
        for (size_t c = 0; c < 3; ++c) pixel[c] *= pixel[3];
      }
    });
  }
  return image;
}

void writeImageFile(const Image& image, const std::string& path, bool keep_values) {
  validateImage(image);
  const std::string extension = lowerExtension(path);
  if (extension == ".png") return writePng(image, path, keep_values);
  if (extension == ".exr") return writeExr(image, path, keep_values);
  fail(ErrorCode::kUnsupported, path + " cannot be written as an image: its extension is '" +
                                    extension + "'; .png and .exr are supported");
}

}  // namespace stipple
