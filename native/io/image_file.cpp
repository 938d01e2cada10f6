#include "io/image_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "io/input_file.h"
#include "io/media_library.h"
#include "io/output_file.h"
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

Image readImageFile(const std::string& path) {
  // Names a missing or unreadable file in the words of every reader.
  { const InputFile file(path); }
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
  image.width = info.width;
  image.height = info.height;
  image.channels = info.channels;
  image.transfer = info.is_display != 0 ? Transfer::kSrgb : Transfer::kLinear;
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
  const std::string ending = lowerEnding(path);
  if (ending == ".png") return writePng(image, path, keep_values);
  if (ending == ".exr") return writeExr(image, path, keep_values);
  fail(ErrorCode::kUnsupported, path + " cannot be written as a picture: its ending is '" + ending +
                                    "'; .png and .exr are supported");
}

}  // namespace stipple
