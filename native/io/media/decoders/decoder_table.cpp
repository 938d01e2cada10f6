// Which decoder reads a picture: what its first bytes say, whatever its name ends with.
#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/bytes/input_file.h"
#include "io/media/decoders/decoders.h"

namespace stipple::media {

namespace {

enum class Format { kUnknown, kPng, kJpeg, kWebp, kExr };

constexpr size_t kMagicBytes = 12;

Format formatOf(const unsigned char* bytes, size_t count) {
  const auto holds = [&](size_t at, const char* magic, size_t length) {
    return count >= at + length && std::memcmp(bytes + at, magic, length) == 0;
  };
  if (holds(0, "\x89PNG", 4)) return Format::kPng;
  if (holds(0, "\xff\xd8", 2)) return Format::kJpeg;
  if (holds(0, "RIFF", 4) && holds(8, "WEBP", 4)) return Format::kWebp;
  if (holds(0, "\x76\x2f\x31\x01", 4)) return Format::kExr;
  return Format::kUnknown;
}

std::unique_ptr<PictureFile> openBytes(Format format, PictureBytes bytes) {
  switch (format) {
    case Format::kPng:
      return openPng(std::move(bytes));
    case Format::kJpeg:
      return openJpeg(std::move(bytes));
    case Format::kWebp:
      return openWebp(std::move(bytes));
    case Format::kExr:
    case Format::kUnknown:
      break;
  }
  fail(ErrorCode::kUnsupported, bytes.name + " is not a PNG, JPEG or WebP image");
}

}  // namespace

void toFloats(const unsigned char* values, size_t pixel_count, int channels, int first, int end,
              float* pixels) {
  constexpr float kStep = 1.0f / 255.0f;
  for (size_t i = 0; i < pixel_count; ++i) {
    const unsigned char* from = values + i * static_cast<size_t>(channels);
    for (int c = first; c < end; ++c) *pixels++ = static_cast<float>(from[c]) * kStep;
  }
}

std::unique_ptr<PictureFile> openPicture(const std::string& path) {
  const InputFile file(path);
  std::array<unsigned char, kMagicBytes> head{};
  const size_t count = static_cast<size_t>(std::min<uint64_t>(file.size(), head.size()));
  file.readAt(0, head.data(), count);
  const Format format = formatOf(head.data(), count);
  if (format == Format::kExr) return openExr(path);
  if (format == Format::kUnknown) {
    fail(ErrorCode::kFormat,
         path + " is not an image that can be read: this build reads PNG, JPEG, WebP and OpenEXR");
  }
  PictureBytes bytes;
  bytes.own.resize(static_cast<size_t>(file.size()));
  file.readAt(0, bytes.own.data(), bytes.own.size());
  bytes.data = bytes.own.data();
  bytes.count = bytes.own.size();
  bytes.name = path;
  return openBytes(format, std::move(bytes));
}

std::unique_ptr<PictureFile> openPicture(const std::vector<unsigned char>& bytes,
                                         const std::string& name) {
  return openBytes(formatOf(bytes.data(), bytes.size()), {{}, bytes.data(), bytes.size(), name});
}

}  // namespace stipple::media
